"""The physics with values that are identified for each body: a row of the tables."""

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import Predicted, Predictor
from sain_core.scene import POSE
from sain_core.storage import read_arrays, write_arrays
from sain_model.dynamics.identify import infer_bodies, pushes_of_bodies, with_beliefs
from sain_model.inference.kinds import Kind, surface_kind
from sain_model.inference.population import Pair, Population, Shown


@dataclass(frozen=True, eq=False)
class Physics:
    """The physics with what is believed of each body, pushed or not."""

    population: Population

    def predict(self, pushes: PushTable) -> Predicted:
        """Return what the physics predicts with the values of each body."""
        kind, data = self.population.kind, with_beliefs(pushes.dataset, self.population)
        after = [kind.step(part.bodies, part.state, part.action, part.given) for part in data.parts]
        return Predicted(np.concatenate(after)[:, 0, POSE])

    def identity_of(self, pushes: PushTable) -> bytes:
        """All numbers that are believed of the bodies of pushes."""
        pairs = map(Pair, pushes.object, pushes.surface)
        places = [self.population.place(pair).tobytes() for pair in sorted(set(pairs))]
        return self.population.kind.identity.encode() + b"".join(places)


@dataclass(frozen=True)
class IdentifiedPhysics:
    """The physics with values that pushes of each body and of the others show.

    Attributes:
        folder: where what training pushes show is kept, which many folds share.
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
        population = self._of_training(train)
        return Physics(population.learn(pushes_of_bodies(own.dataset)) if len(own) else population)

    def _of_training(self, train: PushTable) -> Population:
        """Return what the pushes of the training show; kept."""
        digest = hashlib.sha256(f"{train.data.sha256} {self.identity}".encode())
        digest.update(train.row.tobytes())
        path = self.folder / self.key / f"{digest.hexdigest()[:16]}.npz"
        if not path.exists():
            found = infer_bodies(self.kind, train.dataset)
            shown = zip(*found.shown.values(), strict=True)
            arrays = dict(zip(Shown._fields, map(np.stack, shown), strict=True))
            names = {"pairs": np.array(list(found.shown), str), "variances": found.variances}
            write_arrays(path, arrays | names)
        arrays = read_arrays(path)
        pairs = [Pair(*names) for names in arrays.pop("pairs").tolist()]
        variances = arrays.pop("variances")
        each = map(Shown, *(arrays[name] for name in Shown._fields))
        first = Population.before(self.kind)
        return replace(first, variances=variances, shown=dict(zip(pairs, each, strict=True)))
