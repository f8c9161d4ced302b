"""What every shape of a body states, whatever draws, simulates or names it.

A shape is given in its body's frame and in units of the state's radius (`sain_core.scene`). That is
the radius of a disk, and of the circumscribed circle of every shape of the library. Only the cube
has another unit, half of its width: it stands in for the disk of its radius, as in the paper.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache, cached_property
from math import pi
from typing import ClassVar, Final, Self

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, POSITION, RADIUS, THETA, unit, wrap_angle
from sain_core.types import Angles, Mask, Points, Polygons, Scalars

Pair = tuple[float, float]
Vector = tuple[float, float, float]
Triangles = Float[ndarray, "T 3 3"]
Ring = Float[ndarray, "_ 2"]  # one of several, each with its own number of corners

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
    """An upright body of constant cross-section, `DISK_HEIGHT` high where no height is given.

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
    def inertia(self, mass: float, radius: float, height: float = DISK_HEIGHT) -> Vector:
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


def prism_surface(corners: Points, height: float = DISK_HEIGHT) -> Triangles:
    """Return the surface (T, 3, 3) [m] of a prism on a convex polygon (M, 2), seen from outside."""
    low, high = -height / 2, height / 2
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


ROUND: Final = 256  # points all along an outline
LEFTMOST: Final = 1e-6  # [radii], within which points are equally far left


@dataclass(frozen=True, eq=False)
class Outline:
    """A closed polygon as a function of the location, in its frame and units of its radius."""

    corners: Float[ndarray, "M 2"]  # (M + 1, 2), from the point with location 0 round to it again
    shares: Float[ndarray, "M"]  # (M + 1,), of the perimeter up to each corner, 0 to 1
    perimeter: float  # [radii]

    def at(self, locations: Angles) -> tuple[Points, Angles]:
        """Return the points (..., 2) [radii] at locations (...,), and the headings of the inward
        normals (...,) [rad] there; at a corner that of the side after it.
        """
        return self._alone.at(0, locations)

    @cached_property
    def _alone(self) -> "Outlines":
        return Outlines.of([self])

    def facing(self, headings: Angles) -> tuple[Angles, Angles]:
        """Return where a push straight through the middle in headings (...,) touches the outline.

        Headings are in the body's frame.

        Returns:
            Locations (...,) and the angles (...,) of these pushes to the normals there [rad]. An
            angle may be too large to be allowed.
        """
        locations, bearings, normals = self._round
        apart = np.abs(wrap_angle(bearings - np.asarray(headings)[..., None] - pi))
        nearest = np.argmin(apart, axis=-1)
        return locations[nearest], wrap_angle(headings - normals[nearest])

    @cached_property
    def inscribed(self) -> float:
        """The radius of the largest circle about the middle within the outline; 0: none."""
        middle = np.zeros(2)
        return max(-float(distance_to_way(middle, middle, self.corners[:-1])), 0.0)

    @cached_property
    def _round(self) -> tuple[Angles, Angles, Angles]:
        """Locations all along the outline, with the bearings of the points and of the normals."""
        locations = np.linspace(-pi, pi, ROUND, endpoint=False)
        points, normals = self.at(locations)
        return locations, np.arctan2(points[..., 1], points[..., 0]), normals


LAST: Final = 1.0 - 1e-12  # share of a perimeter; from 1 on the next outline begins


@dataclass(frozen=True, eq=False)
class Outlines:
    """All sides of several outlines, those of outline i from `keys` = i on; none of round ones."""

    keys: Float[ndarray, "S"]  # number of the outline, and share of its perimeter up to the side
    shares: Float[ndarray, "S"]  # of the perimeter up to the side
    lengths: Float[ndarray, "S"]  # of the side, shares of the perimeter
    corners: Float[ndarray, "S 2"]  # that sides begin at [radii]
    ways: Float[ndarray, "S 2"]  # along sides [radii]
    inward: Float[ndarray, "S"]  # headings of the inward normals [rad]
    is_round: Bool[ndarray, "N"]

    @classmethod
    def of(cls, outlines: Sequence[Outline | None]) -> Self:
        """Return the sides of outlines; None: of a round body."""
        corners = [np.zeros((2, 2)) if one is None else one.corners for one in outlines]
        shares = [np.array([0.0, 1.0]) if one is None else one.shares for one in outlines]
        ways = np.concatenate([np.diff(each, axis=0) for each in corners])
        return cls(
            np.concatenate([number + each[:-1] for number, each in enumerate(shares)]),
            np.concatenate([each[:-1] for each in shares]),
            np.concatenate([np.diff(each) for each in shares]),
            np.concatenate([each[:-1] for each in corners]),
            ways,
            wrap_angle(np.arctan2(ways[:, 1], ways[:, 0]) + pi / 2),
            np.array([one is None for one in outlines]),
        )

    def at(self, numbers: ndarray | int, locations: Angles) -> tuple[Points, Angles]:
        """Return what `Outline.at` does, of outlines at locations (...,); they are broadcast.

        Of round ones it means nothing: their normal is the location.
        """
        share = np.mod(locations, 2 * pi) / (2 * pi)
        side = np.searchsorted(self.keys, numbers + np.minimum(share, LAST), side="right") - 1
        part = (share - self.shares[side]) / self.lengths[side]
        return self.corners[side] + part[..., None] * self.ways[side], self.inward[side]


@cache
def outlines_of(shapes: tuple[Shape, ...]) -> Outlines:
    """Return the outlines of the shapes of bodies."""
    return Outlines.of([None if shape.is_round else outline_of(shape) for shape in shapes])


@cache
def outline_of(shape: Shape) -> Outline:
    """Return the outline of a shape as a function of the location."""
    corners = shape.outline(1.0)
    after = np.roll(corners, -1, axis=0)
    left = corners[:, 0].min() + LEFTMOST
    middles = np.where((after[:, :1] <= left), (corners + after) / 2, corners)
    candidates = np.flatnonzero(corners[:, 0] <= left)
    # A corner that ends a leftmost side is on that side and no start of its own.
    ends_side = np.roll(corners[:, 0], 1)[candidates] <= left
    starts = candidates[~ends_side | (after[candidates, 0] <= left)]
    first = starts[np.argmin(middles[starts, 1])]
    ring = np.roll(corners, -first, axis=0)
    if after[first, 0] <= left:  # begin in the middle of a side
        ring = np.concatenate([middles[first][None], ring[1:], ring[:1]])
    ring = np.concatenate([ring, ring[:1]])
    lengths = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    shares = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    shares[-1] = 1.0
    return Outline(ring, shares, float(lengths.sum()))


def distance_to_way(start: Points, end: Points, corners: Polygons) -> Scalars:
    """Return the distance [m] from straight ways (..., 2) to polygons (..., M, 2) in order.

    Negative where a way begins inside.
    """
    after = np.roll(corners, -1, axis=-2)
    first, last = start[..., None, :], end[..., None, :]
    apart = np.minimum(_to_segment(first, corners, after), _to_segment(last, corners, after))
    apart = np.minimum(apart, _to_segment(corners, first, last)).min(axis=-1)
    crossing = (_side(first, last, corners) * _side(first, last, after) < 0.0) & (
        _side(corners, after, first) * _side(corners, after, last) < 0.0
    )
    inside = is_inside(start, corners)
    return np.where(inside, -apart, np.where(crossing.any(axis=-1), 0.0, apart))


def is_inside(points: Points, corners: Polygons) -> Mask:
    """Tell which points (..., 2) lie within their polygon (..., M, 2)."""
    after = np.roll(corners, -1, axis=-2)
    x, y = points[..., None, 0], points[..., None, 1]
    spans = (corners[..., 1] > y) != (after[..., 1] > y)
    rise = after[..., 1] - corners[..., 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        where = corners[..., 0] + (y - corners[..., 1]) / rise * (after[..., 0] - corners[..., 0])
    return np.asarray((spans & (x < where)).sum(axis=-1) % 2 == 1)


def _to_segment(points: ndarray, start: ndarray, end: ndarray) -> ndarray:
    """Return the distances of points from segments, broadcast."""
    way, offset = end - start, points - start
    size = np.maximum((way * way).sum(-1), 1e-30)
    share = np.clip((offset * way).sum(-1) / size, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * way, axis=-1))


def _side(start: ndarray, end: ndarray, points: ndarray) -> ndarray:
    """Return on which side of lines points lie: positive to their left."""
    way, offset = end - start, points - start
    return np.asarray(way[..., 0] * offset[..., 1] - way[..., 1] * offset[..., 0])
