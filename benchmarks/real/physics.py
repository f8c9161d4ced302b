"""Rows of the physics: with textbook values, and with values identified for each body."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import Predicted, Predictor
from sain_core.scene import POSE
from sain_core.storage import read_arrays, write_arrays
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Kind, surface_kind
from sain_model.inference.laboratory import STEPS, over_bodies
from sain_model.physics.parameters import Values
from sain_model.physics.planar import PlanarPrior

ENOUGH: Final = 80  # pushes of each body that a prior over bodies is made from
MANY: Final = 250  # pushes of a body that its own values are inferred from: more change nothing

OfBodies = Mapping[str, Float[ndarray, "D"]]  # vectors z by the names of bodies


@dataclass(frozen=True)
class NominalPhysics:
    """The physics with textbook values."""

    kind: Kind = field(default_factory=surface_kind)
    key: str = "nominal"
    title: str = "physics, nominal"
    learns_anew: bool = False

    @property
    def identity(self) -> str:
        return self.kind.identity

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn nothing."""
        return Physics(self.kind, {})


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
        values, after, first = self.values(pushes), [], 0
        for part in pushes.dataset.parts:
            rows = slice(first, first + len(part))
            mine = {name: value[rows] for name, value in values.items()}
            after.append(self.kind.step(part.bodies, part.state, part.action, mine))
            first += len(part)
        return Predicted(np.concatenate(after)[:, 0, POSE])

    @property
    def identity(self) -> bytes:
        """All numbers that are believed."""
        config = self.kind.identity.encode()
        return config + b"".join(name.encode() + z.tobytes() for name, z in self.places.items())

    def values(self, pushes: PushTable) -> Values:
        """Return the values of all parameters for each push (M,)."""
        return self.kind.values(self.places_of(pushes))

    def places_of(self, pushes: PushTable) -> Float[ndarray, "M D"]:
        """Return the vector z of the body of each push."""
        nothing = np.zeros(len(self.kind.names))
        places = [self.places.get(one, nothing) for one in pushes.body]
        return np.array(places).reshape(len(pushes), len(self.kind.names))


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
        return Physics(known, {**places, **identified(known, own)})

    def _of_training(self, train: PushTable) -> tuple[Kind, OfBodies]:
        """Return a prior over bodies, and the vectors z of those in the training; kept."""
        digest = hashlib.sha256(f"{train.data.sha256} {self.identity}".encode())
        digest.update(train.row.tobytes())
        path = self.folder / self.key / f"{digest.hexdigest()[:16]}.npz"
        if not path.exists():
            prior = over_bodies(self.kind, observed(first_of_each(train, ENOUGH)))
            places = identified(prior, first_of_each(train, MANY))
            content = {name: np.array(getattr(prior.config, name)) for name in prior.names}
            content |= {"covariance": prior.covariance, "bodies": np.array(list(places))}
            write_arrays(path, content | {"places": np.array(list(places.values()))})
        arrays = read_arrays(path)
        told: dict[str, Any] = {name: float(arrays[name]) for name in self.kind.names}
        config = replace(self.kind.config, **told)
        prior = replace(self.kind, prior=PlanarPrior(config), covariance=arrays["covariance"])
        return prior, dict(zip(arrays["bodies"].tolist(), arrays["places"], strict=True))


def identified(kind: Kind, pushes: PushTable) -> OfBodies:
    """Return the most likely vectors z of the bodies that pushes are of."""
    if not len(pushes):
        return {}
    names = np.unique(pushes.body)
    start = np.zeros((len(names), len(kind.names)))
    found = fit(kind, observed(pushes), start, np.arange(len(names)), STEPS)
    return dict(zip(names.tolist(), found.places, strict=True))


def observed(pushes: PushTable) -> list[ObservedPushes]:
    """Return pushes for inference: the episodes are the bodies, in the order of their names."""
    body, parts, first = np.unique(pushes.body, return_inverse=True)[1], [], 0
    for part in pushes.dataset.parts:
        mine = body[first : first + len(part)]
        parts.append(part.observed.in_episodes(mine))
        first += len(part)
    return parts


def first_of_each(pushes: PushTable, count: int) -> PushTable:
    """Return up to so many pushes of each body, evenly from all of them."""
    chosen = []
    for body in np.unique(pushes.body):
        rows = np.flatnonzero(pushes.body == body)
        chosen.append(rows[np.unique(np.linspace(0, len(rows) - 1, count).round().astype(int))])
    return pushes.select(np.sort(np.concatenate(chosen)))
