"""How the disk moves: a path round the block to where a stroke starts, then the stroke, as targets.

The disk has no mass: it follows its target by a PD controller, whatever it pushes. So its path is
certain before it moves. All here is in pixels.
"""

from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from itertools import pairwise, product
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Polygon, box

from pusht.block import MIDDLE, WALLS
from sain_core.errors import UnreachableError

KEEP_OFF: Final = 4.0  # [px], gap between disk and block for which paths are planned
LEAST_GAP: Final = 0.3  # [px], the smallest that is accepted on a path
ROUNDING: Final = 0.01  # [px]
FREE: Final = 100.0  # [px], longest path in a step without contact
AT_SPEED: Final = 0.4  # of the reach of targets: the way in a step at the speed that they allow
CREEP: Final = 9.4  # [px], likewise of an agent that is no disk, in each coordinate
LANDING: Final = 50.0  # [px/s], at the start of a stroke
SLOWER: Final = 0.7 ** np.arange(6)  # factors on the speed of a path, one try after another
STEADY: Final = 0.02  # weight of a target's change, so that targets stay near the places
FIRM: Final = 30.0  # weight of places and velocities where the disk has to be exact


@dataclass(frozen=True)
class Servo:
    """The controller of the disk: acceleration = k_p (target - place) - k_v velocity.

    A motion (2, 2) is a place [px] and a velocity [px/s].
    """

    k_p: float  # [1/s^2]
    k_v: float  # [1/s]
    time_step: float  # [s], of the simulation
    substeps: int  # of the simulation in a step of control
    reach: float = np.inf  # [px], how far a target may be from the place, in each coordinate

    @classmethod
    def of(cls, env: Any, reach: float = np.inf) -> "Servo":
        """Return the controller of an environment."""
        return cls(env.k_p, env.k_v, env.dt, int(1 / (env.dt * env.control_hz)), reach)

    @property
    def free(self) -> float:
        """The longest path [px] in a step without contact."""
        return min(FREE, AT_SPEED * self.reach)

    def allows(self, motion: np.ndarray, targets: np.ndarray) -> bool:
        """Tell whether targets (S, 2) are near enough to the places where they are given."""
        if np.isinf(self.reach):  # targets are places in the room
            return bool(((targets >= 0.0) & (targets <= 2.0 * MIDDLE)).all())
        ends = self.follow(motion, targets)[self.substeps - 1 :: self.substeps, 0]
        return bool((np.abs(targets - [motion[0], *ends[:-1]]) <= self.reach).all())

    @property
    def period(self) -> float:
        """The time [s] of a step of control."""
        return self.time_step * self.substeps

    @cached_property
    def _once(self) -> tuple[np.ndarray, np.ndarray]:
        """What a step of the simulation makes of a motion, and of the target."""
        dt, k_p, k_v = self.time_step, self.k_p, self.k_v
        speed = np.array([-dt * k_p, 1.0 - dt * k_v])
        return np.array([np.array([1.0, 0.0]) + dt * speed, speed]), np.array([dt**2, dt]) * k_p

    def follow(self, motion: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Return the motions (T, 2, 2) after each step of the simulation, for targets (S, 2)."""
        keep, gain = self._once
        moved = []
        for target in np.repeat(targets, self.substeps, axis=0):
            motion = keep @ motion + gain[:, None] * target
            moved.append(motion)
        return np.array(moved)

    def targets(
        self, motion: np.ndarray, places: np.ndarray, stops: dict[int, np.ndarray]
    ) -> np.ndarray:
        """Return targets (S, 2) that lead the disk through places (S, 2), one a step of control.

        By least squares: places are met nearly, the more exactly the less the disk must hurry.
        `stops` are velocities (2,) at the end of steps, by their numbers.
        """
        count, moments = len(places), sorted(stops)
        drift = self._ends(motion, count)  # without targets
        answer = self._ends(np.eye(2), count)[:, :, 0]
        once = self.follow(np.zeros((2, 2)), np.ones((1, 2)))[-1, :, 0]
        answer = np.concatenate([once[None], self._ends(once[:, None], count - 1)[..., 0]])
        later = np.subtract.outer(np.arange(count), np.arange(count))  # (S, S)
        gains = answer[np.maximum(later, 0)] * (later >= 0)[..., None]  # (S, S, 2)
        smooth, first = STEADY * (np.eye(count) - np.eye(count, k=-1)), np.zeros((count, 2))
        first[0] = STEADY * motion[0]
        firm, speed = np.ones((count, 1)), 2.0 * FIRM / self.k_v
        firm[moments] = FIRM
        rows = np.concatenate([firm * gains[..., 0], speed * gains[moments][..., 1], smooth])
        speeds = np.array([stops[moment] for moment in moments])
        wanted = [firm * (places - drift[:, 0]), speed * (speeds - drift[moments, 1]), first]
        return np.linalg.lstsq(rows, np.concatenate(wanted), rcond=None)[0]

    def _ends(self, motion: np.ndarray, count: int) -> np.ndarray:
        """Return motions (count, 2, M) after each step of control, with the target at 0."""
        keep = np.linalg.matrix_power(self._once[0], self.substeps)
        ends = []
        for _ in range(count):
            motion = keep @ motion
            ends.append(motion)
        return np.array(ends).reshape(count, *motion.shape)

    def stroke(self, start: np.ndarray, end: np.ndarray, speed: float) -> np.ndarray:
        """Return the places (S, 2) of a stroke, at the end of each step of control."""
        length = float(np.hypot(*(end - start)))
        return start + ramp(length, speed * self.period)[:, None] * direction(start, end)


def plan_motion(
    servo: Servo,
    room: "Room",
    motion: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    speed: float,
    outline: np.ndarray,
) -> np.ndarray:
    """Return targets (S, 2) that lead the disk to a stroke from start to end (2,), and along it.

    Until the stroke, the disk does not touch the outline (M, 2); if it touches it now, it leaves
    it first. Where a fast path would touch it, or targets would be too far, a slower one is taken.

    Raises:
        UnreachableError: there is no such path between the walls.
    """
    block = Polygon(outline)
    path = room.path_round(motion[0], start, block)
    ways = [(path,)] + [(path[:2], path[1:])] * (len(path) > 2)  # at once, or first off the block
    for slower, way in product(SLOWER, ways):
        approach = np.concatenate([_spread(part, slower * servo.free) for part in way])
        pace = speed if np.isinf(servo.reach) else slower * speed
        places = np.concatenate([approach, servo.stroke(start, end, pace)])
        landing = LANDING * direction(start, end)
        stops = {len(approach) - 1: landing, len(places) - 1: np.zeros(2)}
        targets = servo.targets(motion, places, stops)
        free = servo.follow(motion, targets[: len(approach)])[:, 0]
        gaps = shapely.distance(block, shapely.points(free)) - room.disk
        if servo.allows(motion, targets) and _keeps_off(gaps):
            return targets
    raise UnreachableError(f"no path of the disk to {_shown(start)} px keeps off the block")


@dataclass(frozen=True)
class Room:
    """Where the middle of a disk of this radius [px] can be."""

    disk: float

    @property
    def low(self) -> float:
        """The least coordinate [px]."""
        return WALLS[0] + self.disk

    @property
    def high(self) -> float:
        """The greatest coordinate [px]."""
        return WALLS[1] - self.disk

    def contains(self, places: np.ndarray) -> np.ndarray:
        """Tell which places (..., 2) are between the walls."""
        return ((places >= self.low) & (places <= self.high)).all(axis=-1)

    def shut_off(self, places: np.ndarray, outlines: np.ndarray) -> np.ndarray:
        """Tell which places (B, 2) an outline (B, M, 2) and walls part from most of the room."""
        reach, found = self.disk + KEEP_OFF, np.zeros(len(places), dtype=bool)
        narrow = (outlines < self.low + reach) | (outlines > self.high - reach)
        near = np.flatnonzero(narrow.any(axis=(1, 2)))
        free = shapely.difference(self._free, self._grown(shapely.polygons(outlines[near])))
        parts, row = shapely.get_parts(free, return_index=True)
        order = np.lexsort((shapely.area(parts), row))
        largest = order[np.diff(row[order], append=len(near)) > 0]
        found[near] = shapely.distance(parts[largest], shapely.points(places[near])) > KEEP_OFF
        return found

    def nearest_outside(self, place: np.ndarray, block: Polygon) -> np.ndarray:
        """Return the nearest place (2,) at which the disk keeps off the block."""
        return _outside(place, block.buffer(self.disk + KEEP_OFF))

    def path_round(self, start: np.ndarray, end: np.ndarray, block: Polygon) -> np.ndarray:
        """Return the shortest path (P, 2) from a place to another that keeps off the block."""
        grown = self._grown(block)
        first, last = _outside(start, grown), _outside(end, grown)
        ends = shapely.points([first, last])
        for part in shapely.get_parts(self._free.difference(grown)):
            if (shapely.distance(part, ends) < ROUNDING).all():
                corners = shapely.get_coordinates(part)
                places = [start, *_shortest([first, last, *corners], part.buffer(ROUNDING)), end]
                apart = np.hypot(*np.diff(places, axis=0, prepend=np.inf).T) > ROUNDING
                return np.array(places)[apart]
        raise UnreachableError(
            f"no path of the disk from {_shown(start)} px to {_shown(end)} px, round the block and"
            " between the walls"
        )

    @property
    def _free(self) -> Polygon:
        return box(self.low, self.low, self.high, self.high)

    def _grown(self, block: Any) -> Any:
        """Return where the middle of the disk would be too near a block, or several."""
        return shapely.buffer(block, self.disk + KEEP_OFF, join_style="mitre", mitre_limit=1.5)


@dataclass(frozen=True)
class Hull(Room):
    """Where the centroid of an agent that is no disk can be, while it does not turn.

    Attributes:
        parts: convex ones (M, 2) [px] of the agent about its centroid.
    """

    disk: float = 0.0
    parts: tuple[np.ndarray, ...] = ()

    def contains(self, places: np.ndarray) -> np.ndarray:
        """Tell which places (..., 2) are between the walls."""
        low_x, low_y, high_x, high_y = self._free.bounds
        inside = (places >= [low_x, low_y]) & (places <= [high_x, high_y])
        return inside.all(axis=-1)

    def reaches(self, start: np.ndarray, places: np.ndarray, block: Polygon) -> np.ndarray:
        """Tell which places (B, 2) there is a path to, round a block."""
        free = shapely.get_parts(self._free.difference(self._grown(block)))
        around = free[shapely.distance(free, shapely.Point(start)).argmin()]
        return shapely.distance(around, shapely.points(places)) < 2.0 * KEEP_OFF

    def nearest_outside(self, place: np.ndarray, block: Polygon) -> np.ndarray:
        """Return the nearest place (2,) at which the agent keeps off the block."""
        return _outside(place, self._grown(block))

    def path(self, start: np.ndarray, end: np.ndarray, block: Polygon) -> np.ndarray:
        """Return places (S, 2) after each step of control, on the way round a block."""
        corners, places = self.path_round(start, end, block), []
        for here, after in pairwise(corners):
            count = int(np.ceil(np.abs(after - here).max() / CREEP)) or 1
            places.append(here + np.linspace(0.0, 1.0, count + 1)[1:, None] * (after - here))
        return np.concatenate([*places, corners[-1:]])

    @property
    def _free(self) -> Polygon:
        corners = np.concatenate(self.parts)
        return box(*(WALLS[0] - corners.min(axis=0)), *(WALLS[1] - corners.max(axis=0)))

    def _grown(self, block: Any) -> Any:
        """Return where the agent would be too near a block: the sum of block and mirrored agent."""
        ring = np.array(block.exterior.coords)
        sides = np.stack([ring[:-1], ring[1:]], axis=1)  # (M, 2, 2)
        sums = []
        for part in self.parts:
            around = (sides[:, :, None] - part).reshape(len(sides), -1, 2)
            sums += list(shapely.convex_hull(shapely.multipoints(around)))
            sums.append(shapely.Polygon(ring - part[0]))
        return _filled(shapely.union_all(sums)).buffer(
            KEEP_OFF, join_style="mitre", mitre_limit=1.5
        )


def _filled(region: Any) -> Polygon:
    return Polygon(region.exterior)


def direction(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the unit vector (2,) from a place (2,) to another; 0 where they are the same."""
    return (end - start) / max(float(np.hypot(*(end - start))), 1e-9)


def ramp(total: float, most: float) -> np.ndarray:
    """Return distances (S,) up to `total` of which the first and the last step are short."""
    count = max(int(np.ceil(total / most)) + 1, 2)
    return total * np.minimum((np.arange(1, count + 1) - 0.5) / (count - 1), 1.0)


def _outside(place: np.ndarray, grown: Polygon) -> np.ndarray:
    point = shapely.Point(place)
    if not grown.contains(point):
        return place
    return shapely.get_coordinates(shapely.shortest_line(grown.exterior, point))[0]


def _shortest(places: list[np.ndarray], free: Polygon) -> list[np.ndarray]:
    """Return the shortest path from the first place to the second, over others (Dijkstra)."""
    far, before, done = [np.inf] * len(places), [0] * len(places), set()
    far[0], queue = 0.0, [(0.0, 0)]
    shapely.prepare(free)
    while queue:
        so_far, here = heappop(queue)
        if here in done:
            continue
        done.add(here)
        for other, place in enumerate(places):
            reach = so_far + float(np.hypot(*(place - places[here])))
            if reach < far[other] and free.covers(shapely.LineString([places[here], place])):
                far[other], before[other] = reach, here
                heappush(queue, (reach, other))
    path = [1]
    while path[-1] != 0:
        path.append(before[path[-1]])
    return [places[index] for index in reversed(path)]


def _spread(path: np.ndarray, most: float) -> np.ndarray:
    """Return places (S, 2) along a path (P, 2), no further apart than `most`, without the first."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    done = ramp(float(lengths[-1]), most)
    return np.stack([np.interp(done, lengths, path[:, axis]) for axis in range(2)], axis=-1)


def _keeps_off(gaps: np.ndarray) -> bool:
    """Tell whether gaps (T,) are never too small, but for a beginning in which they grow."""
    enough = gaps >= LEAST_GAP
    leaving = np.diff(gaps, prepend=gaps[0]) >= -ROUNDING
    first = int(np.argmax(enough)) if enough.any() else len(enough)
    return bool(leaving[:first].all() and enough[first:].all())


def _shown(place: np.ndarray) -> str:
    return f"({place[0]:.0f}, {place[1]:.0f})"
