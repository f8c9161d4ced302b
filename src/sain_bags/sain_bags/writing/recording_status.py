"""The status that a recorder prints while it records and at the end."""

import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.live import Live
from rich.text import Text

from sain_bags.writing.gaps import Gaps
from sain_bags.writing.writer import BagWriter

HOUSEKEEPING: Final = frozenset({"/rosout", "/parameter_events"})  # silent where all is well
LIVE_PERIOD: Final = 0.5  # [s] between looks on a terminal


class RecordingStatus:
    """The progress of a recording."""

    def __init__(
        self,
        writer: BagWriter,
        gaps: Mapping[str, Gaps],
        unusable: Collection[str],
        awaited: Collection[str],
        seconds: float,
    ) -> None:
        """Take what was written in so many seconds; `awaited` are topics nobody publishes yet."""
        self.counts, self.first, self.size = writer.counts, writer.first, writer.size
        self.seconds, self.unusable = seconds, tuple(unusable)
        self.messages, self.files = sum(self.counts.values()), len(writer.files)
        self.missing = [(name, gap.text()) for name, gap in gaps.items() if gap.missing]
        heard = {name for name, count in self.counts.items() if count}
        silent = {*gaps, *awaited} - heard - HOUSEKEEPING
        self.silent = tuple(sorted(silent))  # published or asked for, without a message

    def line(self, rate: float) -> str:
        """Return the status in a line, with the rate of messages since the last one [1/s]."""
        minutes, seconds = divmod(int(self.seconds), 60)
        parts = [
            f"{minutes:02d}:{seconds:02d}",
            f"{self.messages:,} messages",
            f"{rate:,.0f}/s",
            f"{self.size / 1e6:,.2f} MB" + (f" in {self.files} files" if self.files > 1 else ""),
            f"{len(self.counts)} topics"
            + (f", {len(self.unusable)} unusable" if self.unusable else "")
            + (f", {len(self.silent)} silent" if self.silent else ""),
            self.gaps(),
        ]
        return "  ".join(parts)

    def gaps(self) -> str:
        """Return the missing messages as text."""
        if not self.missing:
            return f"none missing since {self._first()}" if self.messages else "nothing heard"
        return "missing: " + ", ".join(f"{count} of {name}" for name, count in self.missing)

    def _first(self) -> str:
        """Return when the first message came: what was lost before cannot show."""
        return time.strftime("%H:%M:%S", time.localtime(1e-9 * (self.first or 0)))

    def final(self, out: Path, size: int) -> str:
        """Return the last line for a recording of this size [bytes]."""
        files = f" in {self.files} files" if self.files > 1 else ""
        named = f"\nNo message came on {', '.join(self.silent)}" if self.silent else ""
        named += f"\nNot recorded: {', '.join(self.unusable)}" if self.unusable else ""
        return (
            f"Recorded {self.messages:,} messages on {len(self.counts)} topics"
            f" in {self.seconds:.1f} s, {self.gaps()}: {out} ({size / 1e6:.2f} MB{files}){named}"
        )


class StatusDisplay:
    """Shows the status: one live line on a terminal, a line at intervals elsewhere."""

    def __init__(self, console: Console, period: float) -> None:
        """Show it on a console; without a terminal at this period [s], 0: never."""
        self._console = console
        live = console.is_terminal
        self._live = Live(console=console, auto_refresh=False, transient=True) if live else None
        self._period = LIVE_PERIOD if live else period
        self._shown_at = time.monotonic()
        self._messages = 0

    def show(self, status: Callable[[], RecordingStatus]) -> None:
        """Show the status when the period is over."""
        now = time.monotonic()
        passed = now - self._shown_at
        if not self._period or passed < self._period:
            return
        found = status()
        line = found.line((found.messages - self._messages) / passed)
        self._shown_at, self._messages = now, found.messages
        if self._live is not None:
            self._live.update(Text(line, overflow="ellipsis", no_wrap=True), refresh=True)
        else:
            self._console.print(line, highlight=False, markup=False)

    def __enter__(self) -> "StatusDisplay":
        """Begin to show it."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            self._live.stop()
