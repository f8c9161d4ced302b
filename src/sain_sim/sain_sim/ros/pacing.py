"""A simulator's clock, and when its camera looks. No physics here, and no ROS."""

import time
from collections.abc import Callable
from typing import Final

from sain_sim.camera.camera import Camera
from sain_sim.world.workcell import Sample

NEW: Final = 5.0  # [s], simulated, for which a scene at rest is new: 150 frames at 30 Hz
HASTE: Final = 5.0  # times as fast as the wall clock, where the world runs as fast as possible


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
