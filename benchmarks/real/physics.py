"""The physics with values that are identified for each body: a row of the tables."""

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import Predicted, Predictor
from sain_core.scene import POSE
from sain_core.storage import read_arrays, write_arrays
from sain_model.dynamics.identify import (
    OfBodies,
    infer_bodies,
    over_bodies,
    pushes_of_bodies,
    with_beliefs,
)
from sain_model.inference.kinds import Kind, surface_kind
from sain_model.physics.planar import PlanarPrior

FEW: Final = 80  # pushes of each body that a prior over bodies is made from


@dataclass(frozen=True, eq=False)
class Physics:
    """The physics with what is believed of each body.

    Attributes:
        kind: what is believed of a body of which nothing was seen.
        places: most likely vectors z of bodies of which pushes were seen.
    """

    kind: Kind
    places: OfBodies

    def predict(self, pushes: PushTable) -> Predicted:
        """Return what the physics predicts with the values of each body."""
        data = with_beliefs(pushes.dataset, self.kind, self.places)
        after = [
            self.kind.step(part.bodies, part.state, part.action, part.given) for part in data.parts
        ]
        return Predicted(np.concatenate(after)[:, 0, POSE])

    @property
    def identity(self) -> bytes:
        """All numbers that are believed."""
        config = self.kind.identity.encode()
        return config + b"".join(name.encode() + z.tobytes() for name, z in self.places.items())


@dataclass(frozen=True)
class IdentifiedPhysics:
    """The physics with values that pushes of each body show, and a prior from the other bodies.

    Attributes:
        folder: where priors are kept, which many folds share.
        kind: what is believed before any push.
    """

    folder: Path
    kind: Kind = field(default_factory=surface_kind)
    key: str = "identified"
    title: str = "physics, identified"
    learns_anew: bool = False

    @property
    def identity(self) -> str:
        return self.kind.identity

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn what bodies are like, and what those with own pushes are like."""
        known, places = self._of_training(train)
        return Physics(known, {**places, **infer_bodies(known, own.dataset)})

    def _of_training(self, train: PushTable) -> tuple[Kind, OfBodies]:
        """Return a prior over bodies, and the vectors z of those in the training; kept."""
        digest = hashlib.sha256(f"{train.data.sha256} {self.identity}".encode())
        digest.update(train.row.tobytes())
        path = self.folder / self.key / f"{digest.hexdigest()[:16]}.npz"
        if not path.exists():
            prior, start = over_bodies(self.kind, pushes_of_bodies(train.dataset, FEW)[1])
            places = infer_bodies(prior, train.dataset, start)
            content = {name: np.array(getattr(prior.config, name)) for name in prior.names}
            content |= {"covariance": prior.covariance, "bodies": np.array(list(places))}
            write_arrays(path, content | {"places": np.array(list(places.values()))})
        arrays = read_arrays(path)
        believed: dict[str, Any] = {name: float(arrays[name]) for name in self.kind.names}
        config = replace(self.kind.config, **believed)
        prior = replace(self.kind, prior=PlanarPrior(config), covariance=arrays["covariance"])
        return prior, dict(zip(arrays["bodies"].tolist(), arrays["places"], strict=True))
