"""The scenes of an episode that a page shows: each where things came to rest, and some between."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.types import Scene
from sain_core.wire import decode_disks, decode_stamp


@dataclass(frozen=True)
class Frame:
    """All disks at one moment."""

    stamp: int  # [ns], of the observation
    log_time: int  # [ns since the epoch], received
    scene_id: int
    settled: bool
    scene: Scene  # (N, 8)


class Frames:
    """Scenes as they come. The first settled one of each scene id stays, and a settled one that
    says it again is left out; of the others every n-th stays, n doubling when they are too many.
    """

    def __init__(self, most: int) -> None:
        """Keep at most so many scenes in motion."""
        self._most, self.stride = most, 1
        self._kept: list[tuple[int | None, Frame]] = []  # None: at rest
        self._moving = 0  # of those kept
        self._rests: set[int] = set()  # scene ids
        self.in_motion = 0  # scenes recorded
        self.recorded = 0
        self.unusable = 0  # with NaN, or disks that come or go

    def add(self, message: Any, log_time: int) -> None:
        """Take the next `sain_interfaces/msg/Scene`."""
        self.recorded += 1
        if message.settled:
            if message.scene_id not in self._rests and self._keep(None, message, log_time):
                self._rests.add(message.scene_id)
            return
        if self.in_motion % self.stride == 0 and self._keep(self.in_motion, message, log_time):
            self._moving += 1
            if self._moving > self._most:
                self._thin()
        self.in_motion += 1

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Those that are kept, in the order they came."""
        return tuple(frame for _, frame in self._kept)

    def _keep(self, number: int | None, message: Any, log_time: int) -> bool:
        try:
            scene = decode_disks(message.disks)
        except InvalidInputError:
            self.unusable += 1
            return False
        if self._kept and scene.shape != self._kept[0][1].scene.shape:
            self.unusable += 1
            return False
        time = decode_stamp(message.header.stamp)
        frame = Frame(time, log_time, message.scene_id, bool(message.settled), scene)
        self._kept.append((number, frame))
        return True

    def _thin(self) -> None:
        self.stride *= 2
        self._kept = [
            (number, frame)
            for number, frame in self._kept
            if number is None or number % self.stride == 0
        ]
        self._moving = sum(number is not None for number, _ in self._kept)


def frame_times(frames: Sequence[Frame]) -> np.ndarray:
    """Return when each frame was [s], from the first: by their stamps where these make sense.

    A stamp that goes back, or stamps that never move, are those of a clock that nobody keeps;
    then the times of reception are taken.
    """
    for times in ([frame.stamp for frame in frames], [frame.log_time for frame in frames]):
        array = np.array(times, dtype=np.int64)
        if len(array) and array[-1] > array[0] and (np.diff(array) >= 0).all():
            return np.asarray(1e-9 * (array - array[0]))
    return np.arange(len(frames), dtype=np.float64)
