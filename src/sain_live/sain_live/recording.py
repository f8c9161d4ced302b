"""A recording as the page plays it: what is known at each of its moments."""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sain_live.state import LogLine


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What is known at one time.

    Attributes:
        time: [s], from the start of its chapter.
        values: attributes of `LiveState`, by their names.
    """

    time: float
    values: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Chapter:
    """An episode, or the part of it towards one of its goals.

    Attributes:
        title: as on the report page.
        moments: in order; at least one.
        rests: [s], the start, and the end of each push that was carried out.
    """

    title: str
    moments: tuple[Snapshot, ...]
    rests: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Time [s] of the last moment."""
        return self.moments[-1].time

    @property
    def pushes(self) -> int:
        """How many pushes were carried out."""
        return len(self.rests) - 1

    def at(self, time: float) -> Snapshot:
        """Return the last moment that is not later than a time [s]."""
        number = bisect_right(self.moments, time, key=lambda moment: moment.time)
        return self.moments[max(number - 1, 0)]

    def pushes_at(self, time: float) -> int:
        """Return how many pushes had ended at a time [s]."""
        return max(bisect_right(self.rests, time) - 1, 0)


@dataclass(frozen=True, eq=False)
class Recording:
    """All chapters, at least one, and every line of the log."""

    name: str
    chapters: tuple[Chapter, ...]
    log: tuple[LogLine, ...] = ()
