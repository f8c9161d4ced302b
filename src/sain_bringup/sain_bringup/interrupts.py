"""Signals that ask the program to end, turned into an exception that cannot get lost."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopped(BaseException):
    """A signal asked the program to end."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Interrupts:
    """Raises `Stopped` in the main thread when a signal comes.

    An exception that a signal handler raises within somebody's callback may be swallowed there.
    Inside `deferred` the handler only takes note, and `check` raises.
    """

    def __init__(self) -> None:
        self._number: int | None = None
        self._deferred = False
        for number in SIGNALS:
            signal.signal(number, self._on_signal)

    @property
    def came(self) -> bool:
        """Whether a signal has come."""
        return self._number is not None

    def check(self) -> None:
        """Raise `Stopped` when a signal has come."""
        if self._number is not None:
            raise Stopped(self._number)

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Leave it to `check` to raise what comes within this."""
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self._number = number
        if not self._deferred:
            raise Stopped(number)
