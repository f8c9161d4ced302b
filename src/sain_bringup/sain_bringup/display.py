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
SHOWN_DISTANCES: Final = 8  # of an episode, in one line


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
    def episode(self, number: int, total: int, name: str) -> Iterator["EpisodeView"]:
        """Show an episode while it is played; a line with its outcome stays."""
        with self._waiting if self.console.is_terminal else nullcontext():
            view = EpisodeView(self, f"{number}/{total}  {name}")
            view.show()
            yield view
        style, mark = ("green", "✓") if view.reached else ("red", "✗")
        self._line(style, mark, f"{view.name:<18}", view.summary())

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


class EpisodeView:
    """One episode as it is shown: the distance from target to goal after each push."""

    def __init__(self, display: Display, name: str) -> None:
        self._display = display
        self.name = name
        self.distances: list[float] = []  # [m]
        self.fallbacks = 0  # pushes that were planned without the model
        self.reached = False
        self.ending = ""
        self.why = ""
        self.goals = self.most_goals = 0  # reached in a row, of so many

    def begin(self, most_goals: int) -> None:
        """Say that the next of so many goals in a row was given."""
        self.most_goals, self.ending, self.reached = most_goals, "", False

    @property
    def pushes(self) -> int:
        """Pushes carried out."""
        return max(0, len(self.distances) - 1)

    def at(self, distance: float) -> None:
        """Say how far [m] the target is from the goal, at the start and after each push."""
        self._display.begun += not self.distances
        self.distances.append(distance)
        self.show()

    def planned(self, seconds: float, fallback: bool, why: str = "") -> None:
        """Say how long planning a push took [s], and if the model failed on the way, why."""
        self.show(f"planned in {1e3 * seconds:.0f} ms, pushing")
        if fallback and not self.fallbacks:
            self._display.note(f"{self.name}  planned with physics alone: {why}")
        self.fallbacks += fallback

    def refuse(self, reason: str) -> None:
        """Say that a push was refused, and why."""
        self._display.note(f"{self.name}  a push was refused: {reason}")

    def end(self, reached: bool, why: str = "") -> None:
        """Say that the episode is over."""
        self.reached = reached
        self.goals += reached
        self.ending = "reached" if reached else "not reached"
        self.why = why

    def show(self, doing: str = "planning") -> None:
        """Bring the moving line up to date."""
        way = self._way() or "resetting"
        goal = f"goal {self.goals + 1} of {self.most_goals}  " if self.most_goals > 1 else ""
        self._display.status(f"{self.name}  {goal}{way}  push {self.pushes + 1}: {doing}")

    def summary(self) -> str:
        """Return the line that stays."""
        noun = "push  " if self.pushes == 1 else "pushes"
        several = self.most_goals > 1
        why = f"  {self.goals} of {self.most_goals} goals in a row" if several else ""
        why += f"  {self.why}" if self.why else ""
        why += f"  ({self.fallbacks} without the model)" if self.fallbacks else ""
        return f"{self.pushes:2d} {noun}  {self._way()}{why}"

    def _way(self) -> str:
        if not self.distances:
            return ""
        shown = [f"{1e3 * distance:.0f}" for distance in self.distances]
        if len(shown) > SHOWN_DISTANCES:
            shown[1 : 1 - SHOWN_DISTANCES] = ["…"]
        return f"{' → '.join(shown)} mm"
