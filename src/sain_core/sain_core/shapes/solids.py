"""What bodies stand on: three feet, or a flat bottom, as points that each carry a part of it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations
from math import cos, pi, sin
from typing import Any, ClassVar, Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.guarding.untrusted import MOST_CORNERS, MOST_PARTS
from sain_core.scene import DISK_HEIGHT, unit
from sain_core.shapes.shape import REGULAR_FEET, Pair, Ring, Shape, Solid, Vector, is_inside
from sain_core.types import Mask, Points

INSET: Final = 0.06  # [radii], from the outline to the middle of a foot, where there is room
PLACES: Final = 48  # along the inset outline, of which three are chosen


def balanced_feet(outline: Points) -> ndarray:
    """Return three points (3, 2) within an outline (M, 2) that carry a body at (0, 0) well.

    They stand far apart, and each carries much of the weight. Among choices that are equally good,
    the corner that the outline begins with decides.
    """
    from shapely import Polygon, get_parts  # half the time of an import of this module

    ring = Polygon(outline)
    inset = next(
        area for share in (1.0, 0.5, 0.25, 0.0) if (area := ring.buffer(-share * INSET)).area
    )
    lines = [part.exterior for part in get_parts(inset)]
    steps = np.arange(PLACES) / PLACES
    places = np.concatenate(
        [[line.interpolate(step, normalized=True).coords[0] for step in steps] for line in lines]
    )
    choices = np.array(list(combinations(range(len(places)), 3)))
    first, second, third = places[choices].swapaxes(0, 1)
    area = _cross(second - first, third - first)
    loads = np.stack([_cross(second, third), _cross(third, first), _cross(first, second)])
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.nan_to_num((loads / area).min(axis=0), nan=-1.0, posinf=-1.0, neginf=-1.0)
    best = int(np.argmax(least * np.sqrt(np.abs(area))))
    return np.stack([first[best], second[best], third[best]])


def _cross(first: ndarray, second: ndarray) -> ndarray:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


CELLS: Final = 24  # squares of which a bottom consists, about; those at its rim are cut
FINE: Final = 8  # points along the side of a square, that tell how much of it lies within
EVEN: Final = 9  # supports that carry the same


def flat_bottom(shape: Shape, pressure: float = 0.0) -> tuple[Points, Float[ndarray, "F"]]:
    """Return points (F, 2) [radii] within an outline, and the share of the load on each, (F,).

    `pressure` is the exponent of the distance from the middle: 0 is uniform, above 0 there is more
    towards the rim, below 0 towards the middle.
    """
    reach = shape.circumradius
    side = reach * np.sqrt(_area(shape) / CELLS)
    count = int(np.ceil(reach / side)) * FINE
    line = (np.arange(-count, count) + 0.5) * (side / FINE)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    fine = grid[_within(shape, grid)]
    fine = fine - fine.mean(axis=0)
    _, cell, area = np.unique(
        np.floor(fine / side).astype(int), axis=0, return_inverse=True, return_counts=True
    )
    points = np.zeros((len(area), 2))
    np.add.at(points, cell.reshape(-1), fine)
    points /= area[:, None]
    shares = area * np.maximum(np.hypot(*points.T), 0.25 * side) ** pressure
    return points, shares / shares.sum()


@lru_cache(maxsize=256)
def even_supports(shape: Shape) -> Points:
    """Return points (9, 2) [radii] that carry a body as uniform pressure does, each a ninth of it.

    They are the middles of nine equal parts of the footprint, moved so that they have its second
    moments: a body slides and begins to turn as on the whole bottom, and its torsion is within 5 %.
    """
    line = (np.arange(-60, 60) + 0.5) * (shape.circumradius / 60)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    fine = grid[_within(shape, grid)]
    fine = fine - fine.mean(axis=0)
    middles = np.array([part.mean(axis=0) for strip in _thirds(fine) for part in _thirds(strip)])
    middles -= middles.mean(axis=0)
    stretch = np.linalg.inv(_root(middles)) @ _root(fine)
    return np.asarray(middles @ stretch)


def support_points(shape: Shape, radius: float) -> Points:
    """Return points (F, 2) [m] that a body stands on: its three feet, or nine of a flat bottom."""
    return radius * even_supports(shape) if shape.lies_flat else shape.supports(radius)


def _thirds(points: ndarray) -> list[ndarray]:
    """Cut points (P, 2) into equal parts across the way in which they reach farthest."""
    about = points - points.mean(axis=0)
    spread, axes = np.linalg.eigh(about.T @ about)
    even = spread[0] > 0.99 * spread[1]
    order = np.argsort(about @ (np.array([1.0, 0.0]) if even else axes[:, 1]), kind="stable")
    return [points[part] for part in np.array_split(order, 3)]


def _root(points: Points) -> Float[ndarray, "2 2"]:
    """Return the symmetric root of the second moments of points (P, 2)."""
    spread, axes = np.linalg.eigh(points.T @ points / len(points))
    return np.asarray((axes * np.sqrt(spread)) @ axes.T)


def _area(shape: Shape) -> float:
    """Return the area in units of the square of the circumscribed radius."""
    if shape.is_round:
        return np.pi
    return 0.5 * float(_cross(*_sides(shape.outline(1.0) / shape.circumradius)).sum())


def _within(shape: Shape, points: Points) -> Mask:
    """Tell which points (P, 2) [radii] lie within the outline."""
    if shape.is_round:
        return np.asarray(np.hypot(*points.T) < shape.circumradius)
    corners = shape.outline(1.0)
    return is_inside(points, np.broadcast_to(corners, (len(points), *corners.shape)))


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

    def inertia(self, mass: float, radius: float, height: float = DISK_HEIGHT) -> Vector:
        """Return the principal moments [kg m^2] of a uniform cylinder."""
        across = mass * (3 * radius**2 + height**2) / 12
        return across, across, mass * radius**2 / 2


TOLERANCE: Final = 1e-6  # [radii], within which corners and centroids are equal
GRID: Final = 1e-9  # [radii], to which corners of a union are rounded
SCALES: Final = (1e-3, 1e6)  # the same in any unit: a union is rounded to `GRID`


@dataclass(frozen=True)
class Prism(Shape):
    """An upright prism about its centroid, with a circumscribed radius of 1, on three feet.

    Attributes:
        corners: of its outline, counter-clockwise [radii].
        polygons: convex ones, counter-clockwise, that it is the union of; empty: of its outline.
    """

    corners: tuple[Pair, ...] = ()
    polygons: tuple[tuple[Pair, ...], ...] = ()

    solid: ClassVar = Solid.PRISM

    @property
    def is_traced(self) -> bool:
        """Whether it was measured: only its outline is stated."""
        return not self.polygons

    @classmethod
    def of(cls, name: str, *polygons: tuple[Pair, ...]) -> Self:
        """Return the union of convex polygons of any scale and place.

        Raises `ConfigError`: one is not convex, they do not touch along a side or enclose a hole.
        """
        check_parts(polygons, name)
        outline = union_outline(polygons, name)
        centre = centroid(outline)
        scale = float(np.hypot(*(outline - centre).T).max())
        moved = tuple(_pairs((np.array(polygon) - centre) / scale) for polygon in polygons)
        return cls(name, _pairs(union_outline(moved, name)), moved)

    @cached_property
    def _outline(self) -> Points:
        return np.array(self.corners)

    def outline(self, radius: float) -> Points:
        """Return the corners (M, 2) [m], counter-clockwise."""
        return radius * self._outline

    @cached_property
    def _parts(self) -> tuple[Ring, ...]:
        return tuple(map(np.array, self.polygons)) or convex_parts(self._outline)

    def parts(self, radius: float) -> tuple[Ring, ...]:
        """Return convex polygons (M, 2) [m] that together are the footprint."""
        return tuple(radius * part for part in self._parts)

    @cached_property
    def feet(self) -> tuple[Pair, ...]:
        """Distance [radii] and bearing [rad] of three points that carry the body well."""
        x, y = balanced_feet(self.outline(1.0)).T
        return tuple(zip(np.hypot(x, y).tolist(), np.arctan2(y, x).tolist(), strict=True))

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

    def inertia(self, mass: float, radius: float, height: float = DISK_HEIGHT) -> Vector:
        """Return the moments [kg m^2] of a uniform prism; its products of inertia are left out."""
        here, after = _sides(self.outline(radius))
        share = _cross(here, after)[:, None]
        squares = (share * (here**2 + here * after + after**2)).sum(axis=0) / (6 * share.sum())
        upright = height**2 / 12
        along_x, along_y = (mass * float(square) for square in squares)
        return along_y + mass * upright, along_x + mass * upright, along_x + along_y


def _pairs(points: Points) -> tuple[Pair, ...]:
    return tuple((x, y) for x, y in points.tolist())


def check_parts(polygons: tuple[tuple[Pair, ...], ...], name: str) -> None:
    """Raise `ConfigError` unless each part of a shape is a convex polygon, counter-clockwise."""
    if not 1 <= len(polygons) <= MOST_PARTS:
        raise ConfigError(f"shape {name!r} has {len(polygons)} parts; allowed: 1 to {MOST_PARTS}")
    for number, corners in enumerate(polygons):
        if problem := _part_problem(corners):
            raise ConfigError(f"part {number} of shape {name!r} has {problem}")


def _part_problem(corners: tuple[Pair, ...]) -> str:
    points = np.array(corners)
    if not 3 <= len(corners) <= MOST_CORNERS:
        return f"{len(corners)} corners; it needs 3 or more, and at most {MOST_CORNERS}"
    if not np.isfinite(points).all():
        return f"corners {corners}; give finite ones"
    here, after = _sides(np.roll(points, -1, axis=0) - points)
    turns = np.arctan2(_cross(here, after), (here * after).sum(axis=1))
    if (turns <= 0.0).any() or not np.isclose(turns.sum(), 2 * pi):
        return f"corners {corners}; allowed: a convex polygon, counter-clockwise"
    farthest, (low, high) = float(np.hypot(*points.T).max()), SCALES
    inside = low <= farthest <= high
    return "" if inside else f"its farthest corner at {farthest:.3g}; allowed: {low:g} to {high:g}"


def union_outline(polygons: tuple[tuple[Pair, ...], ...], name: str) -> Points:
    """Return the outline (M, 2) of a union of polygons, counter-clockwise; raises `ConfigError`."""
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


def _sides(points: Points) -> tuple[Points, Points]:
    """Return where each side (M, 2) of a ring of points (M, 2) begins and ends."""
    return points, np.roll(points, -1, axis=0)


def convex_parts(outline: Points) -> tuple[Ring, ...]:
    """Return convex polygons, counter-clockwise, that make up what an outline (M, 2) encloses.

    Triangles are joined across an edge as long as the union stays convex (Hertel and Mehlhorn,
    1983: at most four times as many as are needed).
    """
    from shapely import Polygon, constrained_delaunay_triangles, get_parts, orient_polygons

    whole = Polygon(outline)
    parts = [whole] if _is_convex(whole) else list(get_parts(constrained_delaunay_triangles(whole)))
    joined = len(parts) > 1
    while joined:
        joined = False
        for second in range(len(parts) - 1, 0, -1):
            for first in range(second):
                union = parts[first].union(parts[second])
                if _is_convex(union):
                    parts[first], joined = union, True
                    del parts[second]
                    break
    return tuple(np.array(orient_polygons(part).exterior.coords)[:-1] for part in parts)


def _is_convex(polygon: Any) -> bool:
    hull = polygon.convex_hull
    whole = polygon.geom_type == "Polygon" and not polygon.interiors
    return bool(whole and hull.area - polygon.area < TOLERANCE * hull.area)


class Cube(Prism):
    """An upright square block, about the disk of its radius."""

    solid = Solid.BOX
    feet = REGULAR_FEET


SQUARE: Final = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
CUBE: Final = Cube("cube", SQUARE, (SQUARE,))
