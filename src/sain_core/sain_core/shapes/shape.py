"""What every shape of a body states, whatever draws, simulates or names it.

A shape is given in its body's frame and in units of the state's radius (`sain_core.scene`). That is
the radius of a disk, and of the circumscribed circle of every shape of the library. Only the cube
has another unit, half of its width: it stands in for the disk of its radius, as in the paper.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from math import pi
from typing import ClassVar, Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, POSITION, RADIUS, THETA, unit
from sain_core.types import Points

Pair = tuple[float, float]
Vector = tuple[float, float, float]
Triangles = Float[ndarray, "T 3 3"]

FEET, FLAT = BOTTOMS = ("feet", "flat")  # what bodies stand on
FLAT_MARK: Final = ":flat"  # at the end of a name
FOOT_BEARINGS: Final = (0.0, 2 * pi / 3, 4 * pi / 3)  # [rad], of regular feet
REGULAR_FEET: Final = tuple((0.7, bearing) for bearing in FOOT_BEARINGS)


class Solid(Enum):
    """The solid that simulators and viewers draw a shape with."""

    CYLINDER = "cylinder"
    BOX = "box"
    PRISM = "prism"  # any outline


@dataclass(frozen=True)
class Shape(ABC):
    """An upright body of constant cross-section, `DISK_HEIGHT` high.

    Attributes:
        name: in messages, data sets, scenarios and pictures; ``t:flat`` lies on a flat bottom,
            ``t`` stands on three feet.
    """

    name: str

    solid: ClassVar[Solid]

    @property
    @abstractmethod
    def feet(self) -> tuple[Pair, ...]:
        """Distance [radii] and bearing [rad] of each foot."""

    @abstractmethod
    def parts(self, radius: float) -> tuple[Points, ...]:
        """Return convex polygons (M, 2) [m], counter-clockwise, that together are the footprint."""

    def supports(self, radius: float) -> Points:
        """Return where the feet are (F, 2) [m]."""
        return feet_places(self.feet, radius)

    @property
    @abstractmethod
    def symmetry(self) -> float:
        """The smallest turn [rad] that leaves the outline unchanged; 0: any turn does."""

    @cached_property
    def lies_flat(self) -> bool:
        """Whether the whole footprint lies on the table; else the body stands on its feet."""
        return self.name.endswith(FLAT_MARK)

    @property
    def bottom(self) -> str:
        """What the body stands on: `FEET` or `FLAT`."""
        return FLAT if self.lies_flat else FEET

    def on(self, bottom: str) -> Self:
        """Return the same outline on `FEET` or on a `FLAT` bottom."""
        name = self.name.removesuffix(FLAT_MARK) + (FLAT_MARK if bottom == FLAT else "")
        return self if name == self.name else replace(self, name=name)

    @cached_property
    def is_round(self) -> bool:
        """Whether the outline is a circle, so that no heading differs from another."""
        return self.symmetry == 0.0

    @cached_property
    def is_convex(self) -> bool:
        """Whether every straight line between two of its points stays within it."""
        return len(self.parts(1.0)) == 1

    @property
    def circumradius(self) -> float:
        """The radius of the circumscribed circle, in units of the state's radius."""
        return float(np.hypot(*self.outline(1.0).T).max())

    @cached_property
    def width(self) -> float:
        """The smallest distance of two parallel lines about it, in units of the state's radius."""
        corners = self.outline(1.0)
        bearings = np.linspace(0.0, np.pi, 180, endpoint=False)
        across = corners @ np.stack([np.cos(bearings), np.sin(bearings)])
        return float(np.ptp(across, axis=0).min())

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
        """Return the surface (T, 3, 3) [m] of the body about its centre, seen from outside.

        A body of several parts is the surfaces of all of them.
        """
        return np.concatenate([prism_surface(part) for part in self.parts(radius)])


def feet_places(feet: tuple[Pair, ...], radius: float) -> Points:
    """Return where feet are (F, 2) [m], by their distances [radii] and bearings [rad]."""
    away, bearing = np.array(feet).T
    return np.asarray(radius * away[:, None] * unit(bearing))


def prism_surface(corners: Points) -> Triangles:
    """Return the surface (T, 3, 3) [m] of a prism on a convex polygon (M, 2), seen from outside."""
    low, high = -DISK_HEIGHT / 2, DISK_HEIGHT / 2
    here, after = corners, np.roll(corners, -1, axis=0)
    middle = corners.mean(axis=0)

    def lift(points: Points, height: float) -> ndarray:
        return np.column_stack([points, np.full(len(points), height)])

    bottom, top = (lift(np.broadcast_to(middle, here.shape), z) for z in (low, high))
    faces = (
        (top, lift(here, high), lift(after, high)),
        (bottom, lift(after, low), lift(here, low)),
        (lift(here, low), lift(after, low), lift(after, high)),
        (lift(here, low), lift(after, high), lift(here, high)),
    )
    return np.concatenate([np.stack(face, axis=1) for face in faces])
