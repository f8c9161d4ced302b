"""Where frames are in the world, as ``/tf`` and ``/tf_static`` state them, without tf2."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from sain_core.errors import InvalidInputError
from sain_core.guarding.plugins import did_you_mean
from sain_core.wire import TIPPED, Place, Turn, check_pose, decode_stamp, flat_pose

DEEPEST: Final = 32  # frames from a body to the world
MOST_FRAMES: Final = 1000
TOGETHER: Final = 1.0  # [s], within which a frame may not have two parents


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
        self._root = root
        self._links: dict[str, _Link] = {}

    def take(
        self, parent: str, child: str, place: Sequence[float], turn: Sequence[float], stamp: float
    ) -> None:
        """Take the transform of a frame at a time [s]; `inf` where it never moves.

        Raises `InvalidInputError`: it is no pose, or there are too many frames.
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

    def take_message(self, message: Any, static: bool = False) -> None:
        """Take the frames of a ``TFMessage``, those that never move or others; see `take`."""
        for one in message.transforms:
            place, turn = one.transform.translation, one.transform.rotation
            given = (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
            stamp = inf if static else 1e-9 * decode_stamp(one.header.stamp)
            self.take(one.header.frame_id, one.child_frame_id, *given, stamp)

    def pose(self, frame: str) -> tuple[Float[ndarray, "3"], float]:
        """Return x, y and heading (3,) of a frame in the root, and the oldest stamp on the way.

        Raises `InvalidInputError`: as `transform`, or it is not upright.
        """
        place, turn, stamp = self.transform(frame)
        return flat_pose(place, turn, f"frame {frame!r}", TIPPED), stamp

    def transform(self, frame: str) -> tuple[Place, Turn, float]:
        """Return place and turn of a frame in the root, and the oldest stamp on the way.

        Raises `InvalidInputError`: no such frame was seen, it is not connected, or has two parents.
        """
        place, turn, stamp, name = np.zeros(3), Rotation.identity(), inf, frame
        for _ in range(DEEPEST):
            if name == self._root:
                return place, turn.as_quat(), stamp
            link = self._links.get(name)
            if link is None:
                hint = did_you_mean(frame, self._links)
                why = f"was never seen{hint}" if name == frame else f"ends at {name!r}"
                raise InvalidInputError(
                    f"frame {frame!r} {why} on /tf; it must be connected with {self._root!r}"
                )
            if link.contested:
                raise InvalidInputError(
                    f"frame {name!r} has two parents, {link.contested!r} and {link.parent!r};"
                    " stop one of those who publish it"
                )
            own = Rotation.from_quat(link.turn)
            place, turn = link.place + own.apply(place), own * turn
            stamp, name = min(stamp, link.stamp), link.parent
        raise InvalidInputError(f"frame {frame!r} is in a circle of frames on /tf")
