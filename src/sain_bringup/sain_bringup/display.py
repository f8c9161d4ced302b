"""What a person sees while the closed loop runs: one moving line, and one that stays an episode."""

import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.text import Text

from sain_core.cli.terminal import WaitingLine

WIDTH: Final = 50  # of what a stage did, before the time it took


class Display:
    """Shows progress: in a terminal a moving line, elsewhere plain lines."""

    def __init__(self, console: Console) -> None:
        self.console = console
        self._waiting = WaitingLine(console)
        self.begun = 0  # episodes that were played, whole or in part

    @contextmanager
    def stage(self, doing: str, done: str) -> Iterator[None]:
        """Show that something is under way, then that it is done and how long it took."""
        started = time.monotonic()
        with self._waiting:
            self.status(doing)
            yield
        seconds = time.monotonic() - started
        self._line("green", "✓", f"{done:<{WIDTH}}", f"{seconds:5.1f} s")

    @contextmanager
    def episode(self) -> Iterator[None]:
        """Show an episode while it is played."""
        with self._waiting if self.console.is_terminal else nullcontext():
            yield

    def outcome(self, reached: bool, name: str, summary: str) -> None:
        """Print the line of an episode, which stays."""
        style, mark = ("green", "✓") if reached else ("red", "✗")
        self._line(style, mark, f"{name:<18}", summary)

    def headline(self, what: str, where: Path) -> None:
        """Print what is about to be done, and where its results go."""
        self._print(Text.assemble(("SAIN", "bold"), f"  {what}  ", (f"{where}/", "dim")))

    def status(self, text: str) -> None:
        """Change the moving line."""
        self._waiting.say(text)

    def note(self, text: str) -> None:
        """Print a line that stays, for what deserves attention."""
        self._line("yellow", "!", text, "")

    def _line(self, style: str, mark: str, text: str, more: str) -> None:
        if not self.console.is_terminal and self.console.encoding.lower() != "utf-8":
            mark = {"✓": "ok", "✗": "no"}.get(mark, mark)
        more = f"  {more}" if more else ""
        self._print(Text.assemble("  ", (mark, style), " ", text, (more, "dim")))

    def _print(self, text: Text) -> None:
        self.console.print(text, highlight=False, soft_wrap=True)
