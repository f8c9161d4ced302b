"""What is wrong in a graph, as lines that a person reads once; no middleware here."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Final

from rich.console import Console
from rich.markup import escape

LASTS: Final = 1.5  # [s], after which a warning is printed: many clear by themselves at the start
CLEARED: Final = 0.5  # [s] without a condition, after which it has cleared
FORGOTTEN: Final = 30.0  # [s] without any report, after which its source is gone
AGAIN: Final = 10.0  # [s], least time between lines that differ in their numbers only
LONGEST: Final = 400  # characters of a line
NUMBER: Final = re.compile(r"\d+(\.\d+)?")
REMEDIES: Final = (  # the first pattern that is found; texts with a semicolon have their own remedy
    ("not enabled", "start in another terminal: ros2 run sain_arm enable"),
    ("no calibration on|no image on", "start the camera's driver, or correct its topic"),
    ("no poses have come", "start the node that sees the bodies, or bring their tags into view"),
    ("no model is ready|no model serves", "start: ros2 run sain_model model_node"),
    ("not seen", "bring it into the camera's view, and free it of shadows and covers"),
    ("waits for|^loading|compil", "wait; this ends by itself"),
)


def described(node: str, text: str) -> str:
    """Return the line for what a node reports: node, message, what to do."""
    text = " ".join(text.split())
    found = (remedy for pattern, remedy in REMEDIES if re.search(pattern, text))
    remedy = "" if ";" in text else "; " + next(found, f"look at the log of {node}")
    line, most = f"{node}: {text}", LONGEST - len(remedy)
    return (line if len(line) <= most else f"{line[: most - 3]}...") + remedy


@dataclass
class _Condition:
    """One that a source reports, or reported a moment ago; its numbers may change."""

    line: str
    since: float  # that the source reports this very line [s]
    reported: float = 0.0  # the last time [s]
    cleared: float = inf  # since when it does not report it [s]
    lasts: float = LASTS
    printed: str = ""
    printed_at: float = -inf

    def is_over(self, now: float) -> bool:
        """Tell whether it has cleared, or its source is gone."""
        return now - self.cleared >= CLEARED or now - self.reported >= FORGOTTEN

    def is_due(self, now: float) -> bool:
        """Tell whether its line has to be printed, for the first time or with other numbers."""
        if self.cleared < inf or self.line == self.printed:
            return False
        pause = AGAIN if self.printed else 0.0
        return now - self.since >= self.lasts and now - self.printed_at >= pause


class Conditions:
    """Decides which line is printed when: once for each condition, and again when it comes back."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._conditions: dict[tuple[str, str], _Condition] = {}  # by source and kind of line

    def report(self, source: str, line: str = "", lasts: float = LASTS) -> None:
        """Take note of what a source reports now; "": nothing is wrong.

        Its line is printed once it has lasted so long [s].
        """
        now, kind = self._clock(), NUMBER.sub("#", line)
        for (other, another), condition in self._conditions.items():
            if other == source and another != kind:
                condition.cleared = min(condition.cleared, now)
        if not line:
            return
        self._remove_cleared(now)
        found = self._conditions.setdefault((source, kind), _Condition(line, now))
        if found.line != line and found.printed:  # not yet printed: it lasts, whatever its numbers
            found.since = now
        found.line, found.reported, found.cleared, found.lasts = line, now, inf, lasts

    def take(self) -> list[str]:
        """Return the lines that are to be printed now."""
        now = self._clock()
        self._remove_cleared(now)
        due = [one for one in self._conditions.values() if one.is_due(now)]
        for condition in due:
            condition.printed, condition.printed_at = condition.line, now
        return [condition.line for condition in due]

    def _remove_cleared(self, now: float) -> None:
        kept = {key: one for key, one in self._conditions.items() if not one.is_over(now)}
        self._conditions = kept


def show_line(console: Console, line: str) -> None:
    """Print a line."""
    console.print(f"[yellow]![/] {escape(line)}", highlight=False, soft_wrap=True)
