"""Where frames are in the world, as ``/tf`` and ``/tf_static`` state them, without tf2."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, inf, isfinite
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError

DEEPEST: Final = 32  # frames from a body to the world
MOST_FRAMES: Final = 1000
TOGETHER: Final = 1.0  # [s], within which a frame may not have two parents
UNIT: Final = 0.01  # by which the length of a quaternion may be off
UPRIGHT: Final = 0.9  # cosine of the largest tilt of a body, 25 degrees
Place = Float[ndarray, "3"]
Turn = Float[ndarray, "4"]  # quaternion x y z w


@dataclass(frozen=True)
class _Link:
    parent: str
    place: Place
    turn: Turn
    stamp: float  # [s]; inf: it never moves
    contested: str = ""  # by another parent, at the same time


class FrameTree:
    """The latest transforms, by their child frames."""

    def __init__(self, root: str) -> None:
        """Begin without a frame; poses are in this one."""
        self._root = root
        self._links: dict[str, _Link] = {}

    def take(
        self, parent: str, child: str, place: Sequence[float], turn: Sequence[float], stamp: float
    ) -> None:
        """Take the transform of a frame at a time [s]; `inf` where it never moves.

        Raises:
            InvalidInputError: it is no pose, or there are too many frames.
        """
        known, contested = self._links.get(child), ""
        if known is None and len(self._links) >= MOST_FRAMES:
            raise InvalidInputError(f"/tf has more than {MOST_FRAMES} frames")
        if known is not None and known.parent != parent and stamp - known.stamp < TOGETHER:
            contested = known.parent
        elif known is not None and stamp < known.stamp:
            return  # /tf has no order
        pose = check_pose(place, turn, f"frame {child!r}")
        self._links[child] = _Link(parent, *pose, stamp, contested)

    def pose(self, frame: str) -> tuple[Float[ndarray, "3"], float]:
        """Return x, y and heading (3,) of a frame in the root, and the oldest stamp on the way.

        Raises:
            InvalidInputError: no such frame was seen, it is not connected, not upright, or has
                two parents.
        """
        place, turn, stamp, name = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), inf, frame
        for _ in range(DEEPEST):
            if name == self._root:
                return flat_pose(place, turn, f"frame {frame!r}"), stamp
            link = self._links.get(name)
            if link is None:
                why = "was never seen" if name == frame else f"ends at {name!r}"
                raise InvalidInputError(
                    f"frame {frame!r} {why} on /tf; it must be connected with {self._root!r}"
                )
            if link.contested:
                raise InvalidInputError(
                    f"frame {name!r} has two parents, {link.contested!r} and {link.parent!r};"
                    " stop one of those who publish it"
                )
            place = link.place + _rotated(link.turn, place)
            turn, stamp, name = _product(link.turn, turn), min(stamp, link.stamp), link.parent
        raise InvalidInputError(f"frame {frame!r} is in a circle of frames on /tf")


def check_pose(place: Sequence[float], turn: Sequence[float], what: str) -> tuple[Place, Turn]:
    """Return a place (3,) [m] and a unit quaternion (4,).

    Raises:
        InvalidInputError: NaN, Inf, or a quaternion that is no rotation.
    """
    if not all(map(isfinite, (*place, *turn))):
        raise InvalidInputError(f"{what} has a number that is NaN or Inf; all must be finite")
    size = float(np.linalg.norm(turn))
    if abs(size - 1.0) > UNIT:
        raise InvalidInputError(
            f"{what} has a quaternion of length {size:.3g}; it must be 1 (x y z w)"
        )
    return np.array(place), np.array(turn) / size


def flat_pose(place: Place, turn: Turn, what: str) -> Float[ndarray, "3"]:
    """Return x, y and heading (3,) of an upright body.

    Raises:
        InvalidInputError: its z axis does not point up.
    """
    x, y, z, w = turn.tolist()
    upright = 1.0 - 2.0 * (x * x + y * y)
    if upright < UPRIGHT:
        tilt = np.degrees(np.arccos(np.clip(upright, -1.0, 1.0)))
        raise InvalidInputError(f"{what} is tilted by {tilt:.0f} degrees; its z axis must point up")
    size = hypot(w, z)
    assert size > 0.0
    heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.array([place[0], place[1], heading])


def _product(first: Turn, second: Turn) -> Turn:
    """Return the quaternion of the second turn, then the first."""
    (a, b, c, d), (x, y, z, w) = first.tolist(), second.tolist()
    return np.array(
        [
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        ]
    )


def _rotated(turn: Turn, place: Place) -> Place:
    axis, w = turn[:3], float(turn[3])
    across = 2.0 * np.cross(axis, place)
    return np.asarray(place + w * across + np.cross(axis, across))
