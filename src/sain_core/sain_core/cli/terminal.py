"""What commands show: tables that never cut a number, and one line that says what is waited for."""

import os
import time
from collections.abc import Iterable, Sequence
from math import inf
from typing import TYPE_CHECKING, Any, Final, Self

from rich.console import Console, ConsoleOptions, JustifyMethod, RenderableType, RenderResult
from rich.markup import escape
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn
    from rich.status import Status

MOST_WIDTH: Final = 10_000  # columns of a line in a pipe
PERIOD: Final = 5.0  # [s] between two lines where there is no terminal
Rows = Iterable[Sequence[str]]


def transient_bar(
    console: Console, *columns: "str | ProgressColumn", refresh_per_second: float = 10
) -> "Progress":
    """Return a bar that leaves nothing behind; without a terminal it shows nothing."""
    from rich.progress import Progress

    return Progress(
        *columns,
        console=console,
        transient=True,
        disable=not console.is_interactive,
        refresh_per_second=refresh_per_second,
    )


class FittingTable(Table):
    """Aligned columns in which long texts are folded where the terminal is narrow; numbers never.

    Print it with ``console.print(table, soft_wrap=True)``. In a pipe a row is always one line,
    unless COLUMNS says how wide lines may be.
    """

    def __init__(self, names: Sequence[str], left: Sequence[str] = (), title: str = "") -> None:
        """Begin with columns, of which the first, or these, are aligned to the left."""
        super().__init__(box=None, header_style="dim", pad_edge=False)
        self._heading = title
        self.padding = (0, 2, 0, 0)
        for name in names:
            text = name in (left or names[:1])
            justify: JustifyMethod = "left" if text else "right"
            self.add_column(Text(name), justify=justify, no_wrap=not text, overflow="fold")

    def add_row(self, *cells: RenderableType | None, **look: Any) -> None:
        """Add a row of as many cells as there are columns; a text is no markup."""
        assert len(cells) == len(self.columns)
        super().add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in cells), **look)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines."""
        if self._heading:
            yield Text(self._heading, style="italic")
        least, wanted = self.__rich_measure__(console, options.update(max_width=MOST_WIDTH))
        limited = console.is_terminal or "COLUMNS" in os.environ
        self.width = max(least, min(wanted, console.width)) if limited else wanted
        yield from super().__rich_console__(console, options.update(no_wrap=False, overflow="fold"))


def make_table(title: str, header: Sequence[str], rows: Rows) -> FittingTable:
    """Return a table: the first column to the left, the others to the right."""
    table = FittingTable(header, title=title)
    for row in rows:
        table.add_row(*row)
    return table


def markdown_table(header: Sequence[str], rows: Rows) -> str:
    """Return a table: the first column to the left, the others to the right."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


class WaitingLine:
    """Shows on a console what is waited for. Use it as a context manager.

    In a terminal the line is gone at the end. Elsewhere a line is printed where a wait lasts longer
    than `patience_s`, and then every five seconds if there is something new to say.
    """

    def __init__(self, console: Console, patience_s: float = PERIOD) -> None:
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

    def __exit__(self, *_: object) -> None:
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
