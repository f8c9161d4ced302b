"""Which pushes the arm can carry out from a scene: pure geometry, batched, shared by all.

The planner masks with it before it rolls out, the simulator refuses with it before it moves.
`Reach` is a plain description of where the tool can go; the simulator checks exact inverse
kinematics on top, and a test holds the two together.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import pi
from typing import Final, Self

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import BlockedError, InvalidInputError, StaleSceneError, UnreachableError
from sain_core.push import BODY, DEFAULT_SPEED, LENGTH, LOCATION, PATH, SPEED, PushLimits, strokes
from sain_core.scene import (
    MID,
    POSITION,
    RADIUS,
    THETA,
    Table,
    X,
    Y,
    check_on_table,
    check_states,
    unit,
)
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import Shape, distance_to_way, outline_of
from sain_core.types import Mask, Points, PushArray, Pushes, Scalars, Scene, Scenes, States

ARC: Final = 90  # corners of a drawn arc
CELLS: Final = 100  # of the table of a ring, from its middle to its end
BETWEEN: Final = 6  # places of a way that are looked up in a table, beside its start
EXACT_WITHIN: Final = 0.05  # [m], from which on a gap to an outline is that to its circle
START_PLACES: Final = 2049  # along an outline


@dataclass(frozen=True)
class Reach(Config):
    """A ring about the arm's base, cut off behind it: the simulated arm's."""

    inner: float = option(0.20, "smallest distance from the base axis", unit="m", minimum=0.0)
    outer: float = option(0.74, "largest distance from the base axis", unit="m", minimum=0.1)
    max_bearing: float = option(2.2, "largest |bearing| seen from the base", unit="rad")

    def contains(self, points: Points) -> Mask:
        """Tell which tool positions (..., 2) the arm can take."""
        x, y = points[..., 0], points[..., 1]
        distance = np.sqrt(x * x + y * y)
        ahead = x >= np.cos(min(self.max_bearing, pi)) * distance  # a tenth of arctan2's time
        return np.asarray((distance >= self.inner) & (distance <= self.outer) & ahead)

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
    def table(self) -> "ReachTable":
        """The squares with all corners in the ring, as a message can state it."""
        line = self.outer / CELLS * np.arange(-CELLS, CELLS + 1)
        at = self.contains(np.stack(np.meshgrid(line, line), axis=-1))
        free = at[1:, 1:] & at[:-1, 1:] & at[1:, :-1] & at[:-1, :-1]
        return ReachTable.of((-self.outer, -self.outer), self.outer / CELLS, free)

    @cached_property
    def outlines(self) -> list[Points]:
        """The corners (M, 2) [m] of its pieces."""
        way = unit(np.linspace(-self.max_bearing, self.max_bearing, ARC))
        return [np.concatenate([self.outer * way, self.inner * way[::-1]])]


@dataclass(frozen=True, eq=False)
class ReachTable(Reach):
    """Squares in all of which the tool can stand, as an arm's driver found them."""

    corner: tuple[float, float] = (0.0, 0.0)  # lowest x and y [m] of the squares
    cell: float = option(0.02, "side of a square", unit="m", minimum=0.001, maximum=0.2)
    free: Bool[ndarray, "Y X"] = field(default_factory=lambda: np.ones((1, 1), dtype=bool))

    @classmethod
    def of(cls, corner: tuple[float, float], cell: float, free: Bool[ndarray, "Y X"]) -> Self:
        """Return a table of squares (Y, X), or raise `InvalidInputError`: none is in reach."""
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

    @cached_property
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
        from scipy.ndimage import distance_transform_edt

        free = np.pad(self.free, 1)  # nothing beyond the table is in reach
        within, beyond = distance_transform_edt(free), distance_transform_edt(~free)
        rooms = np.where(free, within - 0.5, 0.5 - beyond) * self.cell
        return np.asarray(rooms[1:-1, 1:-1])


def reachable(scenes: Scenes, pushes: Pushes, limits: PushLimits, reach: Reach) -> Mask:
    """Tell for which pushes on disks the tool's whole way lies in reach."""
    start, heading = strokes(scenes, pushes, limits)
    return reach.covers(start, unit(heading), pushes[..., LENGTH])


def gap_on_way(
    start: Points, way: Points, scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies
) -> Scalars:
    """Return the smallest gap [m] between the tool on its way and any body but the pushed one.

    It starts at (..., 2) and travels in the direction (..., 2). The other bodies are taken where
    they stand before the push. Negative: they would touch. Infinite: there is no other body.
    """
    if bodies.all_round:
        way_x, way_y = way[..., 0, None], way[..., 1, None]
        x, y = (
            scenes[..., X] - start[..., 0, None],
            scenes[..., Y] - start[..., 1, None],
        )  # (..., N)
        along = np.clip(x * way_x + y * way_y, 0.0, pushes[..., LENGTH, None])
        x, y = x - along * way_x, y - along * way_y
        gaps = np.sqrt(x * x + y * y) - scenes[..., RADIUS] - limits.tool_radius
        other = pushes[..., BODY, None] != np.arange(scenes.shape[-2])
        return np.asarray(gaps.min(axis=-1, initial=np.inf, where=other))
    end = start + pushes[..., LENGTH, None] * way
    pushed, least = pushes[..., BODY], np.full(start.shape[:-1], np.inf)
    for body in range(scenes.shape[-2]):
        passing = np.broadcast_to(pushed != body, least.shape)
        if not passing.any():
            continue
        state = np.broadcast_to(scenes[..., body, :], (*least.shape, scenes.shape[-1]))[passing]
        apart = _way_to_body(start[passing], end[passing], state, bodies.shapes[body])
        least[passing] = np.minimum(least[passing], apart)
    return np.asarray(least - limits.tool_radius)


def start_gap(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies = PAPER_DISKS
) -> Scalars:
    """Return the gap [m] between the tool before it travels and the body that it is to push.

    It is the clearance, but near an inner corner of the outline. Negative: they would touch.
    """
    if all(shape.is_convex for shape in bodies.shapes):
        return np.full(pushes.shape[:-1], limits.clearance)
    pushed = pushes[..., BODY]
    gap = np.full(np.broadcast_shapes(scenes.shape[:-2], pushed.shape), limits.clearance)
    for body, shape in enumerate(bodies.shapes):
        mine = np.broadcast_to(pushed == body, gap.shape)
        if shape.is_convex or not mine.any():
            continue
        radii = np.broadcast_to(scenes[..., body, RADIUS], gap.shape)
        for radius in np.unique(radii[mine]).tolist():
            these = mine & (radii == radius)
            location = np.broadcast_to(pushes[..., LOCATION], gap.shape)[these]
            gap[these] = np.interp(location, *_start_gaps(shape, radius, limits))
    return gap


@lru_cache(maxsize=128)
def _start_gaps(shape: Shape, radius: float, limits: PushLimits) -> tuple[Scalars, Scalars]:
    """Return locations [rad] all along an outline, and the gaps [m] of a tool that starts there.

    The gap depends on nothing else: a table of it takes a hundredth of the time.
    """
    locations = np.linspace(-pi, pi, START_PLACES)
    places, inward = outline_of(shape).at(locations)
    start = radius * places - (limits.tool_radius + limits.clearance) * unit(inward)
    corners = np.broadcast_to(shape.outline(radius), (START_PLACES, *shape.outline(1.0).shape))
    return locations, distance_to_way(start, start, corners) - limits.tool_radius


def _way_to_body(start: Points, end: Points, state: States, shape: Shape) -> Scalars:
    """Return the distance [m] from straight ways (..., 2) to a body in states (..., 8).

    Of ways that pass the circumscribed circle by more than `EXACT_WITHIN`, the distance to that.
    """
    centre, way = state[..., POSITION], end - start
    size = np.maximum((way * way).sum(-1), 1e-30)
    share = np.clip(((centre - start) * way).sum(-1) / size, 0.0, 1.0)
    apart = np.linalg.norm(centre - start - share[..., None] * way, axis=-1)
    if shape.is_round:
        return np.asarray(apart - state[..., RADIUS])
    apart = np.asarray(apart - shape.circumradius * state[..., RADIUS])
    near = apart < EXACT_WITHIN
    if near.any():
        first, last = (_in_frame(points[near], state[near]) for points in (start, end))
        corners = shape.outline(1.0) * state[near][:, RADIUS, None, None]
        apart[near] = distance_to_way(first, last, corners)
    return apart


def _in_frame(points: Points, state: States) -> Points:
    """Return points (B, 2) [m] of the world in the frames of bodies (B, 8)."""
    x, y = (points - state[:, POSITION]).T
    cos, sin = np.cos(state[:, THETA]), np.sin(state[:, THETA])
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


@dataclass(frozen=True)
class Feasibility(Config):
    """Everything that decides whether a push can be carried out."""

    limits: PushLimits = PushLimits()
    reach: Reach = Reach()
    table: Table = Table()
    tool_margin: float = option(
        0.002,
        "smallest gap between the tool and every other disk",
        unit="m",
        minimum=0.0,
        maximum=0.05,
    )

    def mask(self, scenes: Scenes, pushes: Pushes, bodies: Bodies = PAPER_DISKS) -> Mask:
        """Tell which pushes are reachable and unblocked; one of zero length always is.

        A push must also be against a pushable body.
        """
        return self.assess(scenes, pushes, bodies).possible

    def assess(self, scenes: Scenes, pushes: Pushes, bodies: Bodies = PAPER_DISKS) -> "Ways":
        """Return the tool's ways of pushes (..., 5) in scenes (..., N, 8), and what bars them."""
        limits = self.limits
        start, heading = strokes(scenes, pushes, limits, bodies)
        way = unit(heading)
        gap = gap_on_way(start, way, scenes, pushes, limits, bodies)
        possible = self.reach.covers(start, way, pushes[..., LENGTH])
        possible &= gap >= self.tool_margin
        possible &= start_gap(scenes, pushes, self.limits, bodies) >= 0.0
        possible &= np.isin(pushes[..., BODY], bodies.pushable)
        possible |= pushes[..., LENGTH] == 0.0
        return Ways(np.asarray(possible), gap, start, start + pushes[..., LENGTH, None] * way)

    def check_way(
        self, start: Points, way: Points, scene: Scene, push: PushArray, bodies: Bodies
    ) -> None:
        """Check the way of the tool from a start (2,) [m] in a direction (2,), for one push.

        Raises `UnreachableError`: it leaves the reach; `BlockedError`: a body of the scene (N, 8)
        is in it.
        """
        reach = self.reach
        if not reach.covers(start, way, push[LENGTH]):
            numbers = ", ".join(f"{number:.3f}" for number in push[PATH])
            raise UnreachableError(
                f"the tool's way for push ({numbers}) leaves the arm's reach: {reach.describe()}"
            )
        room = float(start_gap(scene, push, self.limits, bodies))
        if room < 0.0:
            raise BlockedError(
                f"the tool would start {-1e3 * room:.1f} mm inside the body that it is to push:"
                " the point is too near an inner corner of the outline"
            )
        gap = float(gap_on_way(start, way, scene, push, self.limits, bodies))
        if gap < self.tool_margin:
            raise BlockedError(
                f"the tool would pass another body with a gap of {1e3 * gap:.1f} mm;"
                f" at least {1e3 * self.tool_margin:g} mm is needed"
            )


@dataclass(frozen=True)
class Ways:
    """The tool's ways of pushes.

    Attributes:
        possible: (...,), see `Feasibility.mask`.
        gaps: (...,) [m], of `gap_on_way`.
        start: (..., 2) [m], of the tool's axis.
        end: (..., 2) [m].
    """

    possible: Mask
    gaps: Scalars
    start: Points
    end: Points


RETREAT: Final = 0.01  # [m], room for errors of the places that bodies are taken to have


@dataclass(frozen=True)
class Stroke:
    """A straight line of the tool from start (2,) to end (2,) [m] in the world."""

    start: Float[ndarray, "2"]
    end: Float[ndarray, "2"]
    heading: float  # of its travel [rad]
    speed: float = DEFAULT_SPEED  # [m/s]
    body: int = MID  # the one that it pushes

    @classmethod
    def of_push(
        cls, scene: Scene, push: PushArray, limits: PushLimits, bodies: Bodies = PAPER_DISKS
    ) -> "Stroke":
        """Return the tool's way for a push (5,) in a scene (N, 8), of disks by default."""
        start, heading = strokes(scene, push, limits, bodies)
        end = start + push[LENGTH] * unit(heading)
        return cls(start, end, float(heading), float(push[SPEED]), int(push[BODY]))

    def from_further_back(self, way: float) -> "Stroke":
        """Return this stroke with a start that lies further back by a way [m]."""
        return replace(self, start=self.start - way * unit(np.asarray(self.heading)))

    @property
    def length(self) -> float:
        """The tool's travel [m]."""
        return float(np.linalg.norm(self.end - self.start))


def checked_stroke(
    push: PushArray,
    scene: Scene,
    settled: bool,
    feasibility: Feasibility,
    bodies: Bodies,
    seen: Float[ndarray, "M 8"] | None = None,
) -> Stroke:
    """Return the tool's way for a push that can be carried out in a scene (N, 8).

    Where the push was planned from a scene as `seen`, the way follows from that, and starts further
    back by `RETREAT`. Raises `SainError`, also where bodies are off the table or still move.
    """
    limits = feasibility.limits
    limits.check(push, bodies)
    if seen is not None:
        check_states(seen)
        if len(seen) != len(scene):
            raise InvalidInputError(
                f"the push was planned for {len(seen)} bodies; this world has {len(scene)}"
            )
    planned_from = scene if seen is None else seen
    stroke = Stroke.of_push(planned_from, push, limits, bodies)
    check_on_table(scene, feasibility.table)
    if not settled:
        raise StaleSceneError("the disks still move; a push needs a settled scene")
    if push[LENGTH] == 0.0:
        return stroke
    way = unit(np.asarray(stroke.heading))
    feasibility.check_way(stroke.start, way, planned_from, push, bodies)
    return stroke if seen is None else _withdrawn(stroke, scene, feasibility, bodies)


def _withdrawn(stroke: Stroke, scene: Scene, feasibility: Feasibility, bodies: Bodies) -> Stroke:
    """Return a stroke that starts further back, for bodies that are seen elsewhere."""
    withdrawn = stroke.from_further_back(RETREAT)
    place = withdrawn.start[None]
    shapes = bodies.fitted(len(scene)).shapes
    gaps = (
        _way_to_body(place, place, state[None], shape)[0]
        for state, shape in zip(scene, shapes, strict=True)
    )
    gap = float(min(gaps)) - feasibility.limits.tool_radius
    if gap < 0.0:
        raise BlockedError(
            f"the tool would be lowered {-1e3 * gap:.1f} mm into a body: it stands elsewhere than"
            " where the push takes it to be"
        )
    return withdrawn
