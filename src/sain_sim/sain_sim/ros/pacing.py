"""The relation of simulated time to wall time."""

import time
from collections.abc import Callable


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
