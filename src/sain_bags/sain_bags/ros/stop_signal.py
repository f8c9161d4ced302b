"""SIGINT and SIGTERM, noted, so that the main flow comes to its end."""

import os
import select
import signal
import time
from contextlib import suppress
from types import FrameType


class StopSignal:
    """Monotonic time, and an end that a signal asks for.

    A handler may run in the middle of another one. So it takes no lock, as that of `Event.set`: a
    second signal would wait for the first for ever. It wakes the wait through a pipe.
    """

    def __init__(self) -> None:
        """Take over SIGINT and SIGTERM."""
        self._came = False
        self._woken, self._wake = os.pipe()
        os.set_blocking(self._wake, False)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic()

    def wait(self, seconds: float) -> bool:
        """Wait so long, or until a signal; tell whether one came."""
        if seconds > 0.0:
            select.select([self._woken], [], [], seconds)  # at once, after a signal
        return self._came

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._came = True
        with suppress(BlockingIOError):  # the pipe is full of signals
            os.write(self._wake, b"!")
