"""Rows of the tables: whatever learns from pushes and predicts others, as one small protocol."""

from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np

from benchmarks.real.pushes import Poses, PushTable
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.scene import POSE
from sain_core.types import Scalars
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import surface_kind

PARTS: Final = ("poses", "radius", "turn")  # of a prediction
SHIPPED: Final = "sain"  # its name
STATED: Final = 0.9  # the level of regions


@dataclass(frozen=True, eq=False)
class Predicted:
    """What is predicted of M pushes.

    Attributes:
        poses: after the pushes.
        radius: [m], of the circle about the place; None: no regions.
        turn: [rad], half of the interval about the heading; None likewise.
    """

    poses: Poses
    radius: Scalars | None = None
    turn: Scalars | None = None


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
class Fixed:
    """A model that learns nothing from the pushes, and has no earlier push."""

    key: str
    title: str
    model: Model
    identity: str = ""
    learns_anew: bool = False

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Learn nothing."""
        return self

    def predict(self, pushes: PushTable) -> Predicted:
        """Return what the model predicts."""
        after = [
            self.model.with_bodies(part.bodies).step(part.state, part.action)
            for part in pushes.dataset.parts
        ]
        return Predicted(np.concatenate(after)[:, 0, POSE])


def fixed_rows() -> list[Row]:
    """Return rows of no motion, of textbook physics, and of the shipped model and its physics."""
    shipped = load_dynamics(SHIPPED)
    assert isinstance(shipped, SainDynamics)
    alone, name = replace(shipped, network=None), shipped.origin.model_hash
    nominal = surface_kind()
    return [
        Fixed("still", "no motion", IdentityPrior()),
        Fixed("nominal", "physics, nominal", nominal.prior, nominal.identity),
        Fixed("shipped_physics", "its physics, as shipped", alone, name),
        Fixed("shipped", "SAIN, as shipped", shipped, name),
    ]


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
    titles = {"sim_quadratic": "limit surface, 2nd order", "sim_poly4": "limit surface, 4th order"}
    return [Published(name, titles.get(name, name)) for name in pushes.published]
