"""Convex polygons: a new shape is an instance of `Polygon`, or of a subclass."""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import ClassVar, Final

import numpy as np

from sain_core.errors import ConfigError
from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.shape import Pair, Shape, Solid, Vector
from sain_core.types import Points

TOLERANCE: Final = 1e-6  # [radii], within which corners and centroids are equal


@dataclass(frozen=True)
class Polygon(Shape):
    """An upright prism with a convex cross-section.

    Attributes:
        corners: counter-clockwise, in units of the state's radius; their centroid is (0, 0).

    Raises:
        ConfigError: corners that are not finite, no convex polygon, clockwise, or off-centre.
    """

    corners: tuple[Pair, ...] = ()

    solid: ClassVar = Solid.PRISM

    def __post_init__(self) -> None:
        """Check the corners."""
        count, corners = len(self.corners), np.array(self.corners)
        if count < 3:
            raise ConfigError(f"shape {self.name!r} has {count} corners; it needs 3 or more")
        if not np.isfinite(corners).all():
            raise ConfigError(f"shape {self.name!r} has corners {self.corners}; give finite ones")
        here, after = _sides(np.roll(corners, -1, axis=0) - corners)
        turns = np.arctan2(_cross(here, after), (here * after).sum(axis=1))
        if (turns <= 0.0).any() or not np.isclose(turns.sum(), 2 * pi):
            raise ConfigError(
                f"shape {self.name!r} has corners {self.corners};"
                " allowed: a convex polygon, counter-clockwise"
            )
        here, after = _sides(corners)
        share = _cross(here, after)
        x, y = ((here + after) * share[:, None]).sum(axis=0) / (3 * share.sum())
        if max(abs(x), abs(y)) > TOLERANCE:
            raise ConfigError(
                f"shape {self.name!r} has its centroid at ({x:.4g}, {y:.4g}); it must be (0, 0)"
            )

    @property
    def symmetry(self) -> float:
        """The smallest turn [rad] that leaves the outline unchanged."""
        count, corners = len(self.corners), self.outline(1.0)
        for parts in range(count, 1, -1):
            turn = 2 * pi / parts
            turned = corners @ np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])
            moved = np.roll(corners, -count // parts, axis=0)
            if count % parts == 0 and np.allclose(turned, moved, atol=TOLERANCE):
                return turn
        return 2 * pi

    def outline(self, radius: float) -> Points:
        """Return the corners (M, 2) [m], counter-clockwise."""
        return radius * np.array(self.corners)

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the moments [kg m^2] of a uniform prism; its products of inertia are left out."""
        here, after = _sides(self.outline(radius))
        share = _cross(here, after)[:, None]
        squares = (share * (here**2 + here * after + after**2)).sum(axis=0) / (6 * share.sum())
        upright = DISK_HEIGHT**2 / 12
        along_x, along_y = (mass * float(square) for square in squares)
        return along_y + mass * upright, along_x + mass * upright, along_x + along_y


def regular_corners(sides: int) -> tuple[Pair, ...]:
    """Return a regular polygon around the unit circle, with one side towards -x."""
    bearings = [pi + (2 * side - 1) * pi / sides for side in range(sides)]
    away = 1.0 / cos(pi / sides)
    return tuple((away * cos(bearing), away * sin(bearing)) for bearing in bearings)


def _sides(points: Points) -> tuple[Points, Points]:
    """Return where each side (M, 2) of a ring of points (M, 2) begins and ends."""
    return points, np.roll(points, -1, axis=0)


def _cross(first: Points, second: Points) -> np.ndarray:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
