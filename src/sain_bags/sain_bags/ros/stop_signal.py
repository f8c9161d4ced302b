"""SIGINT and SIGTERM, noted, so that the main flow comes to its end."""

import signal
import time
from threading import Event
from types import FrameType


class StopSignal:
    """Monotonic time, and an end that a signal asks for."""

    def __init__(self) -> None:
        """Take over SIGINT and SIGTERM."""
        self._end = Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic()

    def wait(self, seconds: float) -> bool:
        """Wait so long, or until a signal; tell whether one came."""
        return self._end.wait(seconds) if seconds > 0.0 else self._end.is_set()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._end.set()
