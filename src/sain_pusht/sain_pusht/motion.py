"""How the disk moves: a path round the block to where a stroke starts, then the stroke, as targets.

The disk of gym-pusht has no mass: it follows its target by a PD controller, whatever it pushes. So
its path is certain before it moves.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from shapely import LineString, Point, Polygon, box
from shapely.ops import nearest_points
from shapely.prepared import PreparedGeometry, prep

from sain_core.errors import UnreachableError
from sain_core.shapes.shape import distance_to_way
from sain_core.types import Mask, Points, Scalars

Place = Float[ndarray, "2"]
Corners = Float[ndarray, "M 2"]  # of an outline, in order
Path = Float[ndarray, "P 2"]  # places one after another
Motion = Float[ndarray, "2 2"]  # place [m] and velocity [m/s] of the disk

KEEP_OFF: Final = 0.004  # [m], gap between tool and block for which paths are planned
LEAST_GAP: Final = 0.0003  # [m], the smallest that is accepted on a path
ROUNDING: Final = 1e-5  # [m], a path that enters what it should avoid by less does not enter it
FREE: Final = 0.1  # [m], longest path in a step without contact
PUSHING: Final = 0.4  # [m/s], speed of a stroke
LANDING: Final = 0.05  # [m/s], at the start of a stroke
TRIES: Final = 6  # of a path, each slower than the one before
SLOWER: Final = 0.7
STEADY: Final = 0.02  # weight of a target's change, so that targets stay near the places
FIRM: Final = 30.0  # weight of places and velocities where the disk has to be exact


@dataclass(frozen=True)
class Room:
    """A square in which places are allowed.

    Attributes:
        low: smallest x and y [m].
        high: largest x and y [m].
    """

    low: float
    high: float

    def contains(self, places: ndarray) -> bool:
        """Tell whether places (..., 2) are all inside."""
        low, high = self.low - ROUNDING, self.high + ROUNDING
        return bool(((places >= low) & (places <= high)).all())

    def around(self, outline: Corners, gap: float) -> list[Polygon]:
        """Return the parts of the room that keep a gap [m] from an outline (M, 2)."""
        room = box(self.low, self.low, self.high, self.high)
        free = room.difference(_grown(outline, gap))
        return list(getattr(free, "geoms", [free]))


def path_round(start: ndarray, end: ndarray, outline: Corners, gap: float, room: Room) -> Path:
    """Return the shortest path (P, 2) [m] from a place to another.

    Args:
        start: (2,) [m]. Nearer to the outline than `gap`, the path first leads straight away
            from it.
        end: (2,) [m]; likewise.
        outline: (M, 2) [m], which the path keeps away from.
        gap: [m], by which, from the tool's axis.
        room: that the path stays in.

    Raises:
        UnreachableError: there is no path.
    """
    grown = _grown(outline, gap)
    first, last = _outside(start, grown), _outside(end, grown)
    for part in room.around(outline, gap):
        if part.distance(Point(first)) < ROUNDING and part.distance(Point(last)) < ROUNDING:
            rings = [part.exterior, *part.interiors]
            corners = [np.array(corner) for ring in rings for corner in ring.coords[:-1]]
            middle = _shortest([first, last, *corners], prep(part.buffer(ROUNDING)))
            return np.array(list(_distinct([start, *middle, end])))
    raise UnreachableError(
        f"no path for the tool from ({start[0]:.3f}, {start[1]:.3f}) m to"
        f" ({end[0]:.3f}, {end[1]:.3f}) m round the block"
    )


def nearest_outside(place: ndarray, outline: Corners, gap: float) -> ndarray:
    """Return the place (2,) nearest to another that has a gap [m] to an outline (M, 2)."""
    return _outside(place, Polygon(outline).buffer(gap))


def _grown(outline: Corners, gap: float) -> Polygon:
    """Return what keeps less than a gap from an outline; cut off beyond its corners."""
    return Polygon(outline).buffer(gap, join_style="mitre", mitre_limit=1.5)


def _outside(place: ndarray, grown: Polygon) -> ndarray:
    if not grown.contains(Point(place)):
        return place
    return np.array(nearest_points(grown.exterior, Point(place))[0].coords[0])


def _shortest(places: list[ndarray], free: PreparedGeometry) -> list[ndarray]:
    """Return the shortest path from the first place to the second, over others (Dijkstra)."""
    far, before, done = [np.inf] * len(places), [0] * len(places), set()
    far[0], queue = 0.0, [(0.0, 0)]
    while queue:
        so_far, here = heappop(queue)
        if here in done:
            continue
        if here == 1:
            break
        done.add(here)
        for other, place in enumerate(places):
            reach = so_far + float(np.hypot(*(place - places[here])))
            if reach < far[other] and free.covers(LineString([places[here], place])):
                far[other], before[other] = reach, here
                heappush(queue, (reach, other))
    path = [1]
    while path[-1] != 0:
        path.append(before[path[-1]])
    return [places[index] for index in reversed(path)]


def _distinct(places: list[ndarray]) -> Iterator[ndarray]:
    """Yield places without those that are where the one before is."""
    last = None
    for place in places:
        if last is None or np.hypot(*(place - last)) > ROUNDING:
            yield place
            last = place


@dataclass(frozen=True)
class Servo:
    """The controller of the disk: acceleration = k_p (target - place) - k_v velocity.

    Attributes:
        k_p: [1/s^2].
        k_v: [1/s].
        time_step: [s], of the simulation.
        substeps: of the simulation in a step of control.
    """

    k_p: float = 100.0
    k_v: float = 20.0
    time_step: float = 0.01
    substeps: int = 10

    @property
    def period(self) -> float:
        """The time [s] of a step of control."""
        return self.time_step * self.substeps

    @cached_property
    def _once(self) -> tuple[ndarray, ndarray]:
        """What a step of the simulation makes of place and velocity, and of the target."""
        dt, k_p, k_v = self.time_step, self.k_p, self.k_v
        speed = np.array([-dt * k_p, 1.0 - dt * k_v])
        return np.array([np.array([1.0, 0.0]) + dt * speed, speed]), np.array([dt**2, dt]) * k_p

    @cached_property
    def _step(self) -> tuple[ndarray, ndarray]:
        """The same for a step of control."""
        keep, gain = self._once
        kept, gained = np.eye(2), np.zeros(2)
        for _ in range(self.substeps):
            kept, gained = keep @ kept, keep @ gained + gain
        return kept, gained

    def follow(self, motion: Motion, targets: Points) -> Float[ndarray, "T 2 2"]:
        """Return the disk's motion after each step of the simulation, for targets (S, 2)."""
        keep, gain = self._once
        moved = np.empty((len(targets) * self.substeps, 2, 2))
        for index in range(len(moved)):
            motion = keep @ motion + gain[:, None] * targets[index // self.substeps]
            moved[index] = motion
        return moved

    def targets(
        self, motion: Motion, places: Points, stops: dict[int, Float[ndarray, "2"]]
    ) -> Points:
        """Return targets (S, 2) that lead the disk through places (S, 2), one a step of control.

        By least squares: places are met nearly, the more exactly the less the disk must hurry.

        Args:
            motion: the disk's now.
            places: [m].
            stops: velocities [m/s] at the end of steps, by their numbers.
        """
        count = len(places)
        keep, gain = self._step
        free, answer = [], []
        here, force = motion, gain
        for _ in range(count):
            here = keep @ here
            free.append(here)
            answer.append(force)
            force = keep @ force
        later = np.subtract.outer(np.arange(count), np.arange(count))  # (S, S)
        gains = np.array(answer)[np.maximum(later, 0)] * (later >= 0)[..., None]  # (S, S, 2)
        drift = np.array(free)  # (S, 2, 2)
        moments = sorted(stops)
        smooth = STEADY * (np.eye(count) - np.eye(count, k=-1))
        first = np.zeros((count, 2))
        first[0] = STEADY * motion[0]
        firm, speed = np.ones((count, 1)), 2.0 * FIRM / self.k_v
        firm[moments] = FIRM
        rows = np.concatenate([firm * gains[..., 0], speed * gains[moments][..., 1], smooth])
        speeds = np.array([stops[moment] for moment in moments]).reshape(-1, 2)
        wanted = np.concatenate(
            [firm * (places - drift[:, 0]), speed * (speeds - drift[moments, 1]), first]
        )
        return np.asarray(np.linalg.lstsq(rows, wanted, rcond=None)[0])


def servo_of(env: Any) -> Servo:
    """Return the controller of a gym-pusht environment."""
    return Servo(env.k_p, env.k_v, env.dt, int(1 / (env.dt * env.control_hz)))


@dataclass(frozen=True)
class DiskStroke:
    """A straight travel of the tool.

    Attributes:
        start: (2,) [m].
        heading: (2,), of length 1.
        length: [m].
        speed: [m/s].
    """

    start: Place
    heading: Place
    length: float
    speed: float = PUSHING

    def at(self, distances: Scalars) -> Points:
        """Return the places (S, 2) after some travel (S,) [m]."""
        return np.asarray(self.start + distances[:, None] * self.heading)


@dataclass(frozen=True)
class Arena:
    """What the disk moves in.

    Attributes:
        servo: its controller.
        room: where its middle may go.
        targets: where its targets may be.
        radius: of the disk [m].
    """

    servo: Servo
    room: Room
    targets: Room
    radius: float

    def gaps(self, places: Points, outline: Corners) -> Scalars:
        """Return the gaps [m] between the disk at places (T, 2) and an outline (M, 2)."""
        corners = np.broadcast_to(outline, (len(places), *outline.shape))
        return np.asarray(distance_to_way(places, places, corners) - self.radius)


def plan_motion(
    motion: Motion, stroke: DiskStroke, outline: Corners, arena: Arena
) -> tuple[Points, int]:
    """Return targets (S, 2) [m] for a stroke, and how many steps lead to where it starts.

    Until then the disk does not touch the outline (M, 2), unless it touches it now: then it leaves
    it. Where a fast path would touch it, a slower one is taken.

    Raises:
        UnreachableError: there is no such path.
    """
    servo = arena.servo
    path = path_round(motion[0], stroke.start, outline, arena.radius + KEEP_OFF, arena.room)
    for slower in SLOWER ** np.arange(TRIES):
        approach = spread(path, slower * FREE)
        places = np.concatenate(
            [approach, stroke.at(ramp(stroke.length, slower * stroke.speed * servo.period))]
        )
        stops = {len(approach) - 1: LANDING * stroke.heading, len(places) - 1: np.zeros(2)}
        targets = servo.targets(motion, places, stops)
        free = servo.follow(motion, targets[: len(approach)])[:, 0]
        if arena.targets.contains(targets) and _keeps_off(arena.gaps(free, outline)):
            return targets, len(approach)
    raise UnreachableError(
        f"no path for the tool to ({stroke.start[0]:.3f}, {stroke.start[1]:.3f}) m that does not"
        " touch the block or end at the walls"
    )


def _keeps_off(gaps: Scalars) -> bool:
    """Tell whether gaps (T,) are never too small, but for a beginning in which they grow."""
    enough: Mask = gaps >= LEAST_GAP
    leaving = np.diff(gaps, prepend=gaps[0]) >= -ROUNDING
    first = int(np.argmax(enough)) if enough.any() else len(enough)
    return bool(leaving[:first].all() and enough[first:].all())


def spread(path: Path, most: float) -> Points:
    """Return places (S, 2) along a path (P, 2), no further apart than `most`, without the first."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    done = ramp(float(lengths[-1]), most)
    return np.stack([np.interp(done, lengths, path[:, axis]) for axis in range(2)], axis=-1)


def ramp(total: float, most: float) -> Scalars:
    """Return distances (S,) up to `total` of which the first and the last step are short."""
    count = max(int(np.ceil(total / most)) + 1, 2)
    share = (np.arange(1, count + 1) - 0.5) / (count - 1)
    return np.asarray(total * np.minimum(share, 1.0))
