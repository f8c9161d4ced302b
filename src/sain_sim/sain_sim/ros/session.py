"""A simulator's ids, its clock, and when its camera looks. No physics here, and no ROS."""

import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from sain_core.errors import (
    BusyError,
    DuplicatePushError,
    InvalidInputError,
    StaleSceneError,
    UnknownEpisodeError,
)
from sain_sim.camera.camera import Camera
from sain_sim.world.workcell import Sample

REMEMBERED_PUSHES: Final = 100_000  # an older push names a stale scene in any case

NEW: Final = 5.0  # [s], simulated, for which a scene at rest is new: 150 frames at 30 Hz
HASTE: Final = 5.0  # times as fast as the wall clock, where the world runs as fast as possible


class Session:
    """The ids of episodes and scenes, and the push under way. Not for use by two threads.

    `episode_id` counts resets from 1. `scene_id` counts resets and executed pushes, and never
    starts again: an episode and a scene name one moment.
    """

    def __init__(self) -> None:
        """Start before the first episode."""
        self.episode_id = 0
        self.scene_id = 0
        self.busy_with: int | None = None
        self._seen: OrderedDict[int, None] = OrderedDict()

    @property
    def busy(self) -> bool:
        """Whether a push is under way."""
        return self.busy_with is not None

    def go_on_from(self, episode_id: int, scene_id: int, last_push: int = 0) -> None:
        """Continue with the ids of another process; its last push is known, too."""
        self.episode_id, self.scene_id = episode_id, scene_id
        if last_push:
            self._remember(last_push)

    def check_idle(self) -> None:
        """Raise `BusyError` if a push is under way."""
        if self.busy:
            raise BusyError(f"push {self.busy_with} is under way; reset when it has ended")

    def begin_episode(self) -> None:
        """Count a reset; raises as `check_idle`."""
        self.check_idle()
        self.episode_id += 1
        self.scene_id += 1

    def admit(self, push_id: int, episode_id: int, scene_id: int) -> None:
        """Take a push as the one under way, until `finish`; a refusal uses up its id too.

        Raises:
            InvalidInputError: the id 0, which means "none".
            DuplicatePushError: an id that was seen before.
            BusyError: another push is under way.
            UnknownEpisodeError: not of the episode that is running.
            StaleSceneError: not planned from the current scene.
        """
        if push_id == 0:
            raise InvalidInputError("push_id is 0; ids start at 1")
        if push_id in self._seen:
            raise DuplicatePushError(f"push {push_id} came before; each push needs a new id")
        self._remember(push_id)
        if self.busy:
            raise BusyError(f"push {self.busy_with} is under way; send push {push_id} anew later")
        if episode_id != self.episode_id:
            raise UnknownEpisodeError(
                f"push {push_id} is for episode {episode_id}; episode {self.episode_id} is running"
            )
        if scene_id != self.scene_id:
            raise StaleSceneError(
                f"push {push_id} was planned from scene {scene_id}; it is scene {self.scene_id} now"
            )
        self.busy_with = push_id

    def finish(self, executed: bool) -> None:
        """End the push under way; one that was executed makes a new scene."""
        self.busy_with = None
        if executed:
            self.scene_id += 1

    def _remember(self, push_id: int) -> None:
        self._seen[push_id] = None
        if len(self._seen) > REMEMBERED_PUSHES:
            self._seen.popitem(last=False)


class Pacer:
    """Simulated time that never goes back: it follows the world and, when idle, wall time.

    With a factor of 0 the world runs as fast as possible, and idle time stands still.
    """

    def __init__(
        self,
        factor: float,
        wall: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Run `factor` times as fast as the wall clock."""
        self._factor = factor
        self._wall = wall
        self._sleep = sleep
        self._idle_s = 0.0
        self._anchor = wall()  # the wall time that belongs to _now
        self._now = 0.0

    @property
    def now(self) -> float:
        """The simulated time [s]."""
        return self._now

    @property
    def now_ns(self) -> int:
        """The simulated time [ns]."""
        return round(self._now * 1e9)

    def go_on_from(self, now: float) -> None:
        """Continue from a simulated time [s] of another process."""
        self._idle_s += now - self._now
        self._now = now

    def idle(self) -> None:
        """Add the wall time since the last call, while the world rests."""
        wall = self._wall()
        passed = (wall - self._anchor) * self._factor
        self._idle_s += passed
        self._now += passed
        self._anchor = wall

    def skip(self, duration: float) -> None:
        """Let simulated time [s] pass at once, while the world rests."""
        self._idle_s += duration
        self._now += duration
        self._anchor = self._wall()

    def follow(self, world_time: float) -> None:
        """Wait until a time of the world [s] is due, and go on to it."""
        now = max(self._now, world_time + self._idle_s)  # sums of floats may differ in last bits
        if self._factor > 0.0:
            due = self._anchor + (now - self._now) / self._factor
            self._sleep(max(0.0, due - self._wall()))
            self._anchor = max(due, self._wall() - 0.1)  # a longer delay is not caught up
        self._now = now


class CameraTimer:
    """A camera over bodies that rest or move. Simulated time goes on from frame to frame."""

    def __init__(self, camera: Camera, pacer: Pacer, factor: float, idle_rate: float) -> None:
        """Look through a camera; the world runs so many times as fast as the wall clock, or 0."""
        self._camera, self._pacer, self._factor = camera, pacer, factor
        self.timer_period = camera.period / (factor or HASTE)  # [s] of wall time
        self._seldom = max(1, round(1.0 / (idle_rate * self.timer_period)))
        self._looks = 0

    def renew(self) -> None:
        """Look at a new scene from now on."""
        self._looks = 0

    def observe(self, sample: Sample) -> bool:
        """Take a frame of bodies at rest, if it is time for one; return whether it was."""
        self._looks += 1
        if self._looks * self._camera.period > NEW and self._looks % self._seldom:
            return False
        if self._factor > 0.0:
            self._pacer.idle()
        else:
            self._pacer.skip(self._camera.period)
        self._camera.observe(sample.scene, self._pacer.now)
        return True

    def observe_moving(self, sample: Sample) -> None:
        """Take a frame of bodies that move."""
        self._camera.observe(sample.scene, self._pacer.now, moving=True)
