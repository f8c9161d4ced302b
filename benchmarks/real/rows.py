"""Rows of the tables: whatever learns from pushes and predicts others, as one small protocol."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Protocol

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.real.pushes import Poses, PushTable
from sain_core.model import load_dynamics
from sain_core.scene import POSE
from sain_model.dynamics.sain import SainDynamics

LEVELS: Final = (0.1, 0.25, 0.5, 0.75, 0.9, 0.95)  # of regions
PARTS: Final = ("poses", "radius", "turn")  # of a prediction
SHIPPED: Final = "sain"  # its name
STATED: Final = 0.9  # the level that models state their regions at


@dataclass(frozen=True, eq=False)
class Predicted:
    """What is predicted of M pushes.

    Attributes:
        poses: after the pushes.
        radius: [m], of the circle about the place for each level; None: no regions.
        turn: [rad], half of the interval about the heading for each level; None likewise.
    """

    poses: Poses
    radius: Float[ndarray, "M L"] | None = None
    turn: Float[ndarray, "M L"] | None = None


class Predictor(Protocol):
    """Predicts pushes, of any body."""

    def predict(self, pushes: PushTable) -> Predicted:
        """Predict what is to be predicted, without a look at what happened."""
        ...


class Row(Protocol):
    """A row of the tables."""

    @property
    def key(self) -> str:
        """Its name in files and results."""
        ...

    @property
    def title(self) -> str:
        """Its name in tables and pictures."""
        ...

    @property
    def identity(self) -> str:
        """All settings that its predictions depend on."""
        ...

    @property
    def learns_anew(self) -> bool:
        """Whether own pushes cost a whole training: then only some numbers of them are tried."""
        ...

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn from pushes, and from a few own ones of bodies that were left out of them."""
        ...


@dataclass(frozen=True)
class NoMotion:
    """Nothing moves."""

    key: str = "still"
    title: str = "no motion"
    identity: str = ""
    learns_anew: bool = False

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn nothing."""
        return self

    def predict(self, pushes: PushTable) -> Predicted:
        """Return the poses before the pushes."""
        return Predicted(pushes.before.copy())


@dataclass(frozen=True)
class Shipped:
    """The model that the package ships, which learned from no real push; or its physics alone."""

    with_network: bool
    learns_anew: bool = False

    @property
    def key(self) -> str:
        return "shipped" if self.with_network else "shipped_physics"

    @property
    def title(self) -> str:
        return "SAIN, as shipped" if self.with_network else "its physics, as shipped"

    @property
    def identity(self) -> str:
        return self._model.origin.model_hash

    @cached_property
    def _model(self) -> SainDynamics:
        model = load_dynamics(SHIPPED)
        assert isinstance(model, SainDynamics)
        return model if self.with_network else replace(model, network=None)

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn nothing."""
        return self

    def predict(self, pushes: PushTable) -> Predicted:
        """Return what it predicts without any earlier push."""
        after = [
            self._model.with_bodies(part.bodies).step(part.state, part.action)
            for part in pushes.dataset.parts
        ]
        return Predicted(np.concatenate(after)[:, 0, POSE])


@dataclass(frozen=True)
class Published:
    """Predictions that come with the data, of models that others fitted to other measurements."""

    key: str
    title: str
    identity: str = ""
    learns_anew: bool = False

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn nothing."""
        return self

    def predict(self, pushes: PushTable) -> Predicted:
        """Return what was published."""
        return Predicted(pushes.published[self.key])


def published_rows(pushes: PushTable) -> list[Row]:
    """Return a row for each published prediction that is with the data."""
    titles = {
        "sim_quadratic": "limit surface, 2nd order",
        "sim_poly4": "limit surface, 4th order",
    }
    return [Published(name, titles.get(name, name)) for name in pushes.published]
