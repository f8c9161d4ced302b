"""The solids of the library: disks, convex polygons, and several that touch (T, L, star)."""

from dataclasses import dataclass, field
from functools import cached_property
from math import cos, pi, sin
from typing import ClassVar, Final, Self

import numpy as np
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.scene import DISK_HEIGHT, unit
from sain_core.shapes.shape import REGULAR_FEET, Pair, Shape, Solid, Vector
from sain_core.shapes.supports import balanced_feet
from sain_core.types import Points

DISK: Final = "disk"
CORNERS: Final = 72  # of an outline


@dataclass(frozen=True)
class Disk(Shape):
    """An upright cylinder."""

    feet: tuple[Pair, ...] = REGULAR_FEET

    solid: ClassVar = Solid.CYLINDER
    symmetry = 0.0
    circumradius = 1.0

    def outline(self, radius: float) -> Points:
        """Return points (72, 2) [m] on a circle."""
        return np.asarray(radius * unit(np.arange(CORNERS) * 2 * pi / CORNERS))

    def parts(self, radius: float) -> tuple[Points, ...]:
        """Return the one polygon that a circle is drawn as."""
        return (self.outline(radius),)

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the principal moments [kg m^2] of a uniform cylinder."""
        across = mass * (3 * radius**2 + DISK_HEIGHT**2) / 12
        return across, across, mass * radius**2 / 2


TOLERANCE: Final = 1e-6  # [radii], within which corners and centroids are equal
GRID: Final = 1e-9  # [radii], to which corners of a union are rounded
REACH: Final = (0.5, 20.0)  # [radii], of the farthest corner; the disk of radius 1 is near it
SCALES: Final = (1e-3, 1e6)  # the same in any unit: a union is rounded to `GRID`
MOST_PARTS: Final = 12
MOST_CORNERS: Final = 64  # of one part


class Prism(Shape):
    """An upright prism; what follows from its outline."""

    solid: ClassVar = Solid.PRISM

    @cached_property
    def symmetry(self) -> float:
        """The smallest turn [rad] that leaves the outline unchanged."""
        corners = self.outline(1.0)
        count = len(corners)
        for parts in range(count, 1, -1):
            turn = 2 * pi / parts
            turned = corners @ np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])
            moved = np.roll(corners, -count // parts, axis=0)
            if count % parts == 0 and np.allclose(turned, moved, atol=TOLERANCE):
                return turn
        return 2 * pi

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the moments [kg m^2] of a uniform prism; its products of inertia are left out."""
        here, after = _sides(self.outline(radius))
        share = _cross(here, after)[:, None]
        squares = (share * (here**2 + here * after + after**2)).sum(axis=0) / (6 * share.sum())
        upright = DISK_HEIGHT**2 / 12
        along_x, along_y = (mass * float(square) for square in squares)
        return along_y + mass * upright, along_x + mass * upright, along_x + along_y


@dataclass(frozen=True)
class Polygon(Prism):
    """An upright prism with a convex cross-section.

    Attributes:
        corners: counter-clockwise, in units of the state's radius; their centroid is (0, 0).

    Raises:
        ConfigError: corners that are not finite, no convex polygon, clockwise, or off-centre.
    """

    corners: tuple[Pair, ...] = ()
    feet: tuple[Pair, ...] = REGULAR_FEET

    def __post_init__(self) -> None:
        """Check the corners."""
        _check_size(self.corners, REACH, f"shape {self.name!r}")
        check_convex(self.corners, f"shape {self.name!r}")
        _check_centre(np.array(self.corners), self.name)

    def outline(self, radius: float) -> Points:
        """Return the corners (M, 2) [m], counter-clockwise."""
        return radius * np.array(self.corners)

    def parts(self, radius: float) -> tuple[Points, ...]:
        """Return the one polygon."""
        return (self.outline(radius),)


@dataclass(frozen=True)
class Compound(Prism):
    """An upright prism whose cross-section is a union of convex polygons, on three feet.

    Attributes:
        polygons: each counter-clockwise, in units of the radius of the circumscribed circle; the
            centroid of their union is (0, 0). `Compound.of` moves and scales others to this.

    Raises:
        ConfigError: a part that is no convex polygon; parts that do not touch along a side or that
            enclose a hole; a union that is off-centre or has another circumscribed radius than 1.
    """

    polygons: tuple[tuple[Pair, ...], ...] = field(default=())

    def __post_init__(self) -> None:
        """Check the parts and their union."""
        check_parts(self.polygons, self.name)
        outline = union_outline(self.polygons, self.name)
        _check_centre(outline, self.name)
        if abs(self.circumradius - 1.0) > TOLERANCE:
            raise ConfigError(
                f"shape {self.name!r} has a circumscribed radius of {self.circumradius:.6g};"
                " it must be 1: make it with Compound.of"
            )

    @classmethod
    def of(cls, name: str, *polygons: tuple[Pair, ...]) -> Self:
        """Return the shape with polygons of any scale and place."""
        check_parts(polygons, name)
        outline = union_outline(polygons, name)
        centre = centroid(outline)
        scale = float(np.hypot(*(outline - centre).T).max())
        moved = (((np.array(polygon) - centre) / scale).tolist() for polygon in polygons)
        return cls(name, tuple(tuple((x, y) for x, y in polygon) for polygon in moved))

    @cached_property
    def feet(self) -> tuple[Pair, ...]:
        """Distance [radii] and bearing [rad] of three points that carry the body well."""
        x, y = balanced_feet(self._outline).T
        return tuple(zip(np.hypot(x, y).tolist(), np.arctan2(y, x).tolist(), strict=True))

    @cached_property
    def _outline(self) -> Points:
        return union_outline(self.polygons, self.name)

    def outline(self, radius: float) -> Points:
        """Return the corners (M, 2) [m] of the union, counter-clockwise."""
        return radius * self._outline

    def parts(self, radius: float) -> tuple[Points, ...]:
        """Return the polygons (M, 2) [m] that the body consists of."""
        return tuple(radius * np.array(polygon) for polygon in self.polygons)


def check_convex(corners: tuple[Pair, ...], what: str) -> None:
    """Raise `ConfigError` unless corners make a convex polygon, counter-clockwise."""
    points = np.array(corners)
    if not 3 <= len(corners) <= MOST_CORNERS:
        raise ConfigError(
            f"{what} has {len(corners)} corners; it needs 3 or more, and at most {MOST_CORNERS}"
        )
    if not np.isfinite(points).all():
        raise ConfigError(f"{what} has corners {corners}; give finite ones")
    here, after = _sides(np.roll(points, -1, axis=0) - points)
    turns = np.arctan2(_cross(here, after), (here * after).sum(axis=1))
    if (turns <= 0.0).any() or not np.isclose(turns.sum(), 2 * pi):
        raise ConfigError(
            f"{what} has corners {corners}; allowed: a convex polygon, counter-clockwise"
        )


def _check_size(corners: tuple[Pair, ...], allowed: Pair, what: str) -> None:
    """Raise `ConfigError` where the farthest corner is at no distance that can be meant."""
    farthest = max((float(np.hypot(x, y)) for x, y in corners), default=allowed[0])
    if np.isfinite(farthest) and not allowed[0] <= farthest <= allowed[1]:
        raise ConfigError(
            f"{what} has its farthest corner at {farthest:.3g}; allowed: {allowed[0]:g} to"
            f" {allowed[1]:g}"
        )


def check_parts(polygons: tuple[tuple[Pair, ...], ...], name: str) -> None:
    """Raise `ConfigError` unless each part of a shape is a convex polygon."""
    if not 1 <= len(polygons) <= MOST_PARTS:
        raise ConfigError(f"shape {name!r} has {len(polygons)} parts; allowed: 1 to {MOST_PARTS}")
    for number, corners in enumerate(polygons):
        _check_size(corners, SCALES, f"part {number} of shape {name!r}")
        check_convex(corners, f"part {number} of shape {name!r}")


def union_outline(polygons: tuple[tuple[Pair, ...], ...], name: str) -> Points:
    """Return the outline (M, 2) of a union of polygons, counter-clockwise.

    Raises:
        ConfigError: the parts do not touch along a side, or enclose a hole.
    """
    from shapely import Polygon as Ring  # half the time of an import of this module
    from shapely import union_all

    union = union_all([Ring(corners) for corners in polygons], grid_size=GRID)
    if union.geom_type != "Polygon":
        raise ConfigError(
            f"the parts of shape {name!r} make {len(union.geoms)} separate pieces;"
            " all must touch along a side"
        )
    if union.interiors:
        raise ConfigError(f"the parts of shape {name!r} enclose a hole; a footprint has none")
    ring = union.simplify(GRID).exterior
    return np.array(ring.coords if ring.is_ccw else ring.coords[::-1])[:-1]


def centroid(outline: Points) -> ndarray:
    """Return the centroid (2,) of the area within an outline (M, 2)."""
    here, after = _sides(outline)
    share = _cross(here, after)
    return np.asarray(((here + after) * share[:, None]).sum(axis=0) / (3 * share.sum()))


def _check_centre(outline: Points, name: str) -> None:
    x, y = centroid(outline)
    if max(abs(x), abs(y)) > TOLERANCE:
        raise ConfigError(
            f"shape {name!r} has its centroid at ({x:.4g}, {y:.4g}); it must be (0, 0)"
        )


def _sides(points: Points) -> tuple[Points, Points]:
    """Return where each side (M, 2) of a ring of points (M, 2) begins and ends."""
    return points, np.roll(points, -1, axis=0)


def _cross(first: Points, second: Points) -> ndarray:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


class Cube(Polygon):
    """An upright square block."""

    solid: ClassVar = Solid.BOX


CUBE: Final = Cube("cube", corners=((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)))
