"""One line that says what a command waits for: moving in a terminal, elsewhere printed at times."""

import time
from math import inf
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from rich.markup import escape

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

PERIOD: Final = 5.0  # [s] between two lines where there is no terminal


class WaitingLine:
    """Shows on a console what is waited for. Use it as a context manager.

    In a terminal the line is gone at the end. Elsewhere a line is printed where a wait lasts longer
    than `patience_s`, and then every five seconds if there is something new to say.
    """

    def __init__(self, console: "Console", patience_s: float = PERIOD) -> None:
        """Show nothing yet."""
        self._console = console
        self._patience_s = patience_s
        self._status: Status | None = None
        self._due = inf
        self._printed = ""

    def __enter__(self) -> Self:
        """Begin to wait."""
        self._due = time.monotonic() + self._patience_s
        if self._console.is_terminal:
            self._status = self._console.status("", spinner_style="cyan")
            self._status.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Clear the line."""
        if self._status is not None:
            self._status.stop()
        self._status, self._due = None, inf

    def say(self, text: str) -> None:
        """Say what is waited for; nothing is shown before and after the wait."""
        if self._status is not None:
            self._status.update(f"[dim]{escape(text)}[/]")
        elif text and text != self._printed and time.monotonic() >= self._due:
            self._console.print(text, style="dim", markup=False, highlight=False, soft_wrap=True)
            self._printed, self._due = text, time.monotonic() + PERIOD
