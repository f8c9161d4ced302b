"""What every shape of a body states, whatever draws, simulates or names it.

A shape is given in its body's frame and in units of the state's radius (`sain_core.scene`).
A shape with sides turns one of them towards -x: a body with heading b shows this side to what
stands behind it in direction b.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum
from math import pi
from typing import ClassVar, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, POSITION, RADIUS, THETA
from sain_core.types import Points

Pair = tuple[float, float]
Vector = tuple[float, float, float]
Triangles = Float[ndarray, "T 3 3"]

FOOT_BEARINGS: Final = (0.0, 2 * pi / 3, 4 * pi / 3)  # [rad], of regular feet
REGULAR_FEET: Final = tuple((0.7, bearing) for bearing in FOOT_BEARINGS)


class Solid(Enum):
    """The solid that simulators and viewers draw a shape with."""

    CYLINDER = "cylinder"
    BOX = "box"
    PRISM = "prism"  # any convex outline


@dataclass(frozen=True)
class Shape(ABC):
    """An upright body of constant cross-section, `DISK_HEIGHT` high.

    Attributes:
        name: in `WorldParameters` messages and in data sets.
        feet: distance [radii] and bearing [rad] of each foot; none: the body lies flat.
    """

    name: str
    feet: tuple[Pair, ...] = REGULAR_FEET

    solid: ClassVar[Solid]

    @property
    def footprint(self) -> str:
        """The name in requests, scenarios and pictures; shapes with one outline may share it."""
        return self.name

    @property
    @abstractmethod
    def symmetry(self) -> float:
        """The smallest turn [rad] that leaves the outline unchanged; 0: any turn does."""

    @property
    def is_round(self) -> bool:
        """Whether the outline is a circle, so that no heading differs from another."""
        return self.symmetry == 0.0

    @property
    def circumradius(self) -> float:
        """The radius of the circumscribed circle, in units of the state's radius."""
        return float(np.hypot(*self.outline(1.0).T).max())

    @abstractmethod
    def outline(self, radius: float) -> Points:
        """Return the corners (M, 2) [m] of a body of this radius, counter-clockwise."""

    @abstractmethod
    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the principal moments [kg m^2] of a uniform body about its centre."""

    def placed(self, state: Float[ndarray, "8"]) -> Points:
        """Return the outline (M, 2) [m] in the world of a body in a state (8,)."""
        cos, sin = np.cos(state[THETA]), np.sin(state[THETA])
        turn = np.array([[cos, sin], [-sin, cos]])  # row vectors times the transpose
        return np.asarray(state[POSITION] + self.outline(float(state[RADIUS])) @ turn)

    def triangles(self, radius: float) -> Triangles:
        """Return the surface (T, 3, 3) [m] of a convex body about its centre, seen from outside."""
        low, high = -DISK_HEIGHT / 2, DISK_HEIGHT / 2
        here = self.outline(radius)
        after = np.roll(here, -1, axis=0)

        def lift(points: Points, height: float) -> ndarray:
            return np.column_stack([points, np.full(len(points), height)])

        bottom, top = (np.broadcast_to([0.0, 0.0, z], (len(here), 3)) for z in (low, high))
        faces = (
            (top, lift(here, high), lift(after, high)),
            (bottom, lift(after, low), lift(here, low)),
            (lift(here, low), lift(after, low), lift(after, high)),
            (lift(here, low), lift(after, high), lift(here, high)),
        )
        return np.concatenate([np.stack(face, axis=1) for face in faces])
