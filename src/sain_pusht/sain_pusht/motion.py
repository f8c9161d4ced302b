"""A stroke as a series of targets: the way to where it starts, and the travel itself."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import UnreachableError
from sain_core.shapes.outline import distance_to_way
from sain_core.types import Mask, Points, Scalars
from sain_pusht.servo import Motion, Servo
from sain_pusht.way import KEEP_OFF, Corners, Room, Way, way_round

Place = Float[ndarray, "2"]

TRIES: Final = 6  # of a way, each slower than the one before
SLOWER: Final = 0.7
NEARER: Final = 1e-5  # [m], by which a tool that leaves the block may come nearer: rounding


@dataclass(frozen=True)
class Pace(Config):
    """How fast the disk moves, and how far it keeps off the block on its way."""

    free: float = option(0.1, "longest way in a step without contact", unit="m", minimum=0.001)
    pushing: float = option(0.04, "longest travel of a stroke in a step", unit="m", minimum=0.001)
    landing: float = option(0.05, "speed at the start of a stroke", unit="m/s", minimum=0.0)
    keep_off: float = option(
        KEEP_OFF, "gap to the block for which ways are planned", unit="m", minimum=0.0005
    )
    least_gap: float = option(
        0.0003, "smallest gap to the block on a way", unit="m", minimum=0.0001
    )


@dataclass(frozen=True)
class DiskStroke:
    """A straight travel of the tool.

    Attributes:
        start: (2,) [m].
        heading: (2,), of length 1.
        length: [m].
    """

    start: Place
    heading: Place
    length: float

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
    motion: Motion, stroke: DiskStroke, outline: Corners, arena: Arena, pace: Pace
) -> tuple[Points, int]:
    """Return targets (S, 2) [m] for a stroke, and how many steps lead to where it starts.

    Until then the disk does not touch the outline (M, 2), unless it touches it now: then it leaves
    it. Where a fast way would, a slower one is taken.

    Raises:
        UnreachableError: there is no such way.
    """
    servo, pushing = arena.servo, pace.pushing
    way = way_round(motion[0], stroke.start, outline, arena.radius + pace.keep_off, arena.room)
    for _ in range(TRIES):
        approach = spread(way, pace.free)
        places = np.concatenate([approach, stroke.at(ramp(stroke.length, pushing))])
        stops = {len(approach) - 1: pace.landing * stroke.heading, len(places) - 1: np.zeros(2)}
        targets = servo.targets(motion, places, stops)
        free = servo.follow(motion, targets[: len(approach)])[:, 0]
        if arena.targets.contains(targets) and _keeps_off(
            arena.gaps(free, outline), pace.least_gap
        ):
            return targets, len(approach)
        pace, pushing = replace(pace, free=SLOWER * pace.free), SLOWER * pushing
    raise UnreachableError(
        f"no way for the tool to ({stroke.start[0]:.3f}, {stroke.start[1]:.3f}) m that does not"
        " touch the block or end at the walls"
    )


def _keeps_off(gaps: Scalars, least: float) -> bool:
    """Tell whether gaps (T,) are never too small, but for a beginning in which they grow."""
    enough: Mask = gaps >= least
    leaving = np.diff(gaps, prepend=gaps[0]) >= -NEARER
    first = int(np.argmax(enough)) if enough.any() else len(enough)
    return bool(leaving[:first].all() and enough[first:].all())


def spread(way: Way, most: float) -> Points:
    """Return places (S, 2) along a way (P, 2), no further apart than `most`, without the first."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    done = ramp(float(lengths[-1]), most)
    return np.stack([np.interp(done, lengths, way[:, axis]) for axis in range(2)], axis=-1)


def ramp(total: float, most: float) -> Scalars:
    """Return distances (S,) up to `total` of which the first and the last step are short."""
    count = max(int(np.ceil(total / most)) + 1, 2)
    share = (np.arange(1, count + 1) - 0.5) / (count - 1)
    return np.asarray(total * np.minimum(share, 1.0))
