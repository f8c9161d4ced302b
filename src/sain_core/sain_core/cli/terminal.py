"""What commands show: tables that never cut a number, and one line that says what is waited for."""

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from math import inf
from textwrap import wrap
from typing import TYPE_CHECKING, Final, Self

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.markup import escape
from rich.text import Text

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn
    from rich.status import Status

GAP: Final = "  "
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


class FittingTable:
    """Aligned columns where they fit the terminal; otherwise each row as ``name: value`` pairs.

    Print it with ``console.print(table, soft_wrap=True)``. In a pipe a row is always one line,
    unless COLUMNS says how wide lines may be.
    """

    def __init__(self, names: Sequence[str], left: Sequence[str] = (), title: str = "") -> None:
        """Begin with columns, of which the first, or these, are aligned to the left."""
        self._title, self._names = title, list(names)
        self._right = [name not in (left or names[:1]) for name in names]
        self._rows: list[list[Text]] = []

    def add_row(self, *cells: str | Text) -> None:
        """Add a row of as many cells as there are columns."""
        assert len(cells) == len(self._names)
        self._rows.append([cell if isinstance(cell, Text) else Text(cell) for cell in cells])

    def __rich_console__(self, console: Console, _: ConsoleOptions) -> Iterator[Text]:
        """Yield the lines."""
        limited = console.is_terminal or "COLUMNS" in os.environ
        if self._title:
            lines = wrap(self._title, console.width) if limited else [self._title]
            yield from (Text(line, style="italic") for line in lines)
        columns = zip(self._names, *(map(str, row) for row in self._rows), strict=True)
        widths = [max(map(cell_len, column)) for column in columns]
        if limited and sum(widths) + len(GAP) * (len(widths) - 1) > console.width:
            for row in self._rows:
                yield from self._pairs(row, console.width)
            return
        yield self._line([Text(name, style="dim") for name in self._names], widths)
        for row in self._rows:
            yield self._line(row, widths)

    def _line(self, cells: list[Text], widths: list[int]) -> Text:
        padded = []
        for cell, width, right in zip(cells, widths, self._right, strict=True):
            space = " " * (width - cell.cell_len)
            padded.append(Text.assemble(space, cell) if right else Text.assemble(cell, space))
        line = Text(GAP).join(padded)
        line.rstrip()
        return line

    def _pairs(self, row: list[Text], width: int) -> Iterator[Text]:
        """Yield a row: its first cell, and below it the others, as many in a line as fit."""
        names = self._names
        start = row[0] if not self._right[0] else Text.assemble(f"{names[0]} ", row[0])
        yield Text.assemble(start, style="bold")
        line = Text()
        for name, cell in zip(names[1:], row[1:], strict=True):
            pair = Text.assemble((f"{name}: " if name else "", "dim"), cell)
            if line and line.cell_len + pair.cell_len + 2 * len(GAP) > width:
                yield Text.assemble(GAP, line)
                line = Text()
            line = Text.assemble(line, GAP if line else "", pair)
        yield Text.assemble(GAP, line)


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
