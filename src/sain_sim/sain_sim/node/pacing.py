"""How simulated time runs beside the clock on the wall, for those who watch."""

import time
from collections.abc import Callable


class Pacer:
    """Simulated time that never goes back: it runs with the world and, when idle, with the wall.

    With a factor of 0 the world runs as fast as it can and idle time stands still.
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

    def idle(self) -> None:
        """Let the time since the last call pass while the world rests."""
        wall = self._wall()
        passed = (wall - self._anchor) * self._factor
        self._idle_s += passed
        self._now += passed
        self._anchor = wall

    def follow(self, world_time: float) -> None:
        """Go on to a time of the world [s], not before it is due."""
        now = world_time + self._idle_s
        if self._factor > 0.0:
            due = self._anchor + (now - self._now) / self._factor
            self._sleep(max(0.0, due - self._wall()))
            self._anchor = max(due, self._wall() - 0.1)  # what was missed by more is let go
        self._now = now
