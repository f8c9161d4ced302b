"""Where an arm's vertical tool can stand: a ring about its base, or a table of places."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Self

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import InvalidInputError
from sain_core.scene import unit
from sain_core.types import Mask, Points, Scalars

ARC: Final = 90  # corners of a drawn arc
BETWEEN: Final = 6  # places of a way that are looked up in a table, beside its start


@dataclass(frozen=True)
class Reach(Config):
    """A ring about the arm's base, cut off behind it: the simulated arm's."""

    inner: float = option(0.20, "smallest distance from the base axis", unit="m", minimum=0.0)
    outer: float = option(0.74, "largest distance from the base axis", unit="m", minimum=0.1)
    max_bearing: float = option(2.2, "largest |bearing| seen from the base", unit="rad")

    def contains(self, points: Points) -> Mask:
        """Tell which tool positions (..., 2) the arm can take."""
        distance = np.hypot(points[..., 0], points[..., 1])
        bearing = np.abs(np.arctan2(points[..., 1], points[..., 0]))
        return np.asarray(
            (distance >= self.inner) & (distance <= self.outer) & (bearing <= self.max_bearing)
        )

    def covers(self, start: Points, way: Points, length: Scalars) -> Mask:
        """Tell which ways (...,) from a start (..., 2) in a direction (..., 2) lie in reach.

        The ring is not convex: a way is checked where it starts, ends and comes nearest the base.
        """
        nearest = np.clip(-(start * way).sum(-1), 0.0, length)
        ok = self.contains(start)
        ok &= self.contains(start + nearest[..., None] * way)
        ok &= self.contains(start + length[..., None] * way)
        return np.asarray(ok)

    def room(self, points: Points) -> Scalars:
        """Return how far [m] points (..., 2) are from where the reach ends; negative: beyond."""
        distance = np.linalg.norm(points, axis=-1)
        bearing = np.abs(np.arctan2(points[..., 1], points[..., 0]))
        room = np.minimum(distance - self.inner, self.outer - distance)
        return np.minimum(room, (self.max_bearing - bearing) * distance)

    def describe(self) -> str:
        """Return it in words, for error messages."""
        return f"{self.inner} to {self.outer} m from the base, |bearing| <= {self.max_bearing} rad"

    @property
    def outlines(self) -> list[Points]:
        """The corners (M, 2) [m] of its pieces."""
        way = unit(np.linspace(-self.max_bearing, self.max_bearing, ARC))
        return [np.concatenate([self.outer * way, self.inner * way[::-1]])]


@dataclass(frozen=True, eq=False)
class ReachTable(Reach):
    """Squares in all of which the tool can stand, as an arm's driver found them.

    Attributes:
        corner: lowest x and y [m] of the squares.
        cell: their side [m].
        free: (Y, X), which of them the tool can stand in.
    """

    corner: tuple[float, float] = (0.0, 0.0)
    cell: float = option(0.02, "side of a square", unit="m", minimum=0.001, maximum=0.2)
    free: Bool[ndarray, "Y X"] = field(default_factory=lambda: np.ones((1, 1), dtype=bool))

    @classmethod
    def of(cls, corner: tuple[float, float], cell: float, free: Bool[ndarray, "Y X"]) -> Self:
        """Return a table of squares (Y, X).

        Raises:
            InvalidInputError: there is no square that the tool can stand in.
        """
        if free.ndim != 2 or not free.any():
            raise InvalidInputError(
                f"the table of reach has {free.shape} squares, none of them in reach; at least one"
                " must be"
            )
        return cls(corner=corner, cell=cell, free=free)

    def contains(self, points: Points) -> Mask:
        """Tell which tool positions (..., 2) the arm can take."""
        column, row, inside = self._cells(points)
        return np.asarray(self.free[row, column] & inside)

    def covers(self, start: Points, way: Points, length: Scalars) -> Mask:
        """Tell which ways (...,) from a start (..., 2) in a direction (..., 2) lie in reach."""
        ok = self.contains(start)
        for share in np.arange(1, BETWEEN + 1) / BETWEEN:
            ok &= self.contains(start + (share * length)[..., None] * way)
        return np.asarray(ok)

    def room(self, points: Points) -> Scalars:
        """Return how far [m] points (..., 2) are from where the reach ends; negative: beyond."""
        column, row, _ = self._cells(points)
        low = np.array(self.corner)
        high = low + self.cell * np.array(self.free.shape[::-1])
        beyond = np.linalg.norm(points - np.clip(points, low, high), axis=-1)
        return np.asarray(self._rooms[row, column] - beyond)

    def describe(self) -> str:
        """Return it in words, for error messages."""
        rows, columns = np.nonzero(self.free)
        x, y = (
            np.array([index.min(), index.max() + 1]) * self.cell + low
            for index, low in zip((columns, rows), self.corner, strict=True)
        )
        return f"within x {x[0]:.2f} to {x[1]:.2f} m, y {y[0]:.2f} to {y[1]:.2f} m"

    @property
    def outlines(self) -> list[Points]:
        """The corners (M, 2) [m] of its pieces."""
        from shapely import box, get_parts, union_all

        squares = [
            box(x, y, x + self.cell, y + self.cell)
            for x, y in (
                np.array(self.corner) + self.cell * np.argwhere(self.free)[:, ::-1]
            ).tolist()
        ]
        return [np.array(part.exterior.coords)[:-1] for part in get_parts(union_all(squares))]

    def _cells(self, points: Points) -> tuple[ndarray, ndarray, Mask]:
        """Return columns and rows (...,) of the squares nearest to points, and which lie in one."""
        places = np.floor((points - np.array(self.corner)) / self.cell)
        most = np.array(self.free.shape[::-1]) - 1
        inside = ((places >= 0) & (places <= most)).all(axis=-1)
        column, row = np.moveaxis(np.clip(places, 0, most).astype(int), -1, 0)
        return column, row, inside

    @cached_property
    def _rooms(self) -> Float[ndarray, "Y X"]:
        """How far the middle of each square is from where the reach ends."""
        free = np.pad(self.free, 1)
        near = np.zeros_like(free)  # squares beside some of the other kind
        for axis in (0, 1):
            differs = np.diff(free, axis=axis)
            first, last = (np.s_[:-1], np.s_[1:]) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
            near[first] |= differs
            near[last] |= differs
        rooms = np.empty(free.shape)
        for kind, sign in ((True, 1.0), (False, -1.0)):
            border = np.argwhere(near & (free != kind))
            places = np.argwhere(free == kind)
            apart = np.linalg.norm(places[:, None] - border, axis=-1).min(axis=1)
            rooms[free == kind] = sign * (apart - 0.5) * self.cell
        return np.asarray(rooms[1:-1, 1:-1])
