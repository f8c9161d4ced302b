"""A recording as the page plays it: what is known at each of its moments, put into `LiveState`."""

import time
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Event, RLock, Thread
from typing import Any, Final

from sain_core.errors import InvalidInputError
from sain_live.state import LOG_LINES, LiveState, LogLine


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What is known at one time."""

    time: float  # [s], from the start of its chapter
    values: Mapping[str, Any]  # attributes of `LiveState`, by their names


@dataclass(frozen=True, eq=False)
class Chapter:
    """An episode, or the part of it towards one of its goals."""

    title: str  # as on the report page
    moments: tuple[Snapshot, ...]  # in order; at least one
    rests: tuple[float, ...]  # [s], the start, and the end of each push that was carried out

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


STEP: Final = 1.0 / 40.0  # [s], between two moments that are shown
HOLD: Final = 1.0  # [s], the end of a chapter stays, before the next one begins


class RecordingPlayer:
    """One for all viewers: each sees the same moment. To be used from any thread.

    Attributes:
        recording: what is played.
        speed: recorded time / playing time.
        playing: whether time goes on.
    """

    def __init__(
        self, state: LiveState, recording: Recording, speed: float = 1.0, loop: bool = True
    ) -> None:
        """Play from the start of the first chapter; with `loop` again and again."""
        self.recording, self.speed, self.playing = recording, speed, True
        self._state, self._loop = state, loop
        self._chapter, self._time = 0, 0.0
        self._lock, self._end = RLock(), Event()
        self._show()
        self._thread = Thread(target=self._run, name="player", daemon=True)
        self._thread.start()

    @property
    def chapter(self) -> Chapter:
        """The one that is shown."""
        return self.recording.chapters[self._chapter]

    @property
    def time(self) -> float:
        """Time [s] in that chapter."""
        return min(self._time, self.chapter.duration)

    @property
    def push(self) -> int:
        """How many pushes of that chapter have ended."""
        return self.chapter.pushes_at(self._time)

    def close(self) -> None:
        """Play no more."""
        self._end.set()
        self._thread.join()

    def set_speed(self, speed: float) -> None:
        """Play at another speed from now on."""
        self.speed = speed

    def play(self, playing: bool) -> None:
        """Let time go on, or stand still; at the end of everything it begins again."""
        with self._lock:
            at_end = self._chapter == len(self.recording.chapters) - 1
            if playing and at_end and self._time >= self.chapter.duration:
                self._chapter, self._time = 0, 0.0
            self.playing = playing
            self._show()

    def open(self, title: str) -> None:
        """Go to the start of a chapter. Raises `InvalidInputError`: there is none of that title."""
        titles = [chapter.title for chapter in self.recording.chapters]
        if title not in titles:
            raise InvalidInputError(f"there is no {title!r}; there are {', '.join(titles)}")
        self._go(titles.index(title), 0.0)

    def seek(self, seconds: float) -> None:
        """Stand still at a time [s] of this chapter."""
        with self._lock:
            self.playing = False
            self._go(self._chapter, min(max(seconds, 0.0), self.chapter.duration))

    def seek_push(self, number: int) -> None:
        """Stand still at the end of a push of this chapter; 0: its start."""
        self.seek(self.chapter.rests[min(max(number, 0), self.chapter.pushes)])

    def step(self, forward: bool) -> None:
        """Stand still at the end of the next or previous push, if need be of another chapter."""
        with self._lock:
            self.playing, rests = False, self.chapter.rests
            later = [rest for rest in rests if rest > self._time]
            earlier = [rest for rest in rests if rest < self.time]
            if later if forward else earlier:
                self._go(self._chapter, later[0] if forward else earlier[-1])
            else:
                self._go(self._chapter + (1 if forward else -1), 0.0 if forward else None)

    def _go(self, chapter: int, seconds: float | None) -> None:
        """Show a time [s] of a chapter, None: its last rest; beyond the last comes the first."""
        with self._lock:
            self._chapter = chapter % len(self.recording.chapters)
            self._time = self.chapter.rests[-1] if seconds is None else seconds
            self._show()

    def _show(self) -> None:
        values = self.chapter.at(self._time).values
        lines = values.get("lines", 0)
        log = deque(self.recording.log[max(lines - LOG_LINES, 0) : lines], LOG_LINES)
        self._state.update(**{"log": log, **values})

    def _run(self) -> None:
        before = time.monotonic()
        while not self._end.wait(STEP):
            now = time.monotonic()
            with self._lock:
                if self.playing:
                    self._advance((now - before) * self.speed)
            before = now

    def _advance(self, seconds: float) -> None:
        self._time += seconds
        if self._time < self.chapter.duration + HOLD * self.speed:
            self._show()
        elif self._loop or self._chapter < len(self.recording.chapters) - 1:
            self._go(self._chapter + 1, 0.0)
        else:
            self._time, self.playing = self.chapter.duration, False
            self._show()
