"""Keeping a deadline: what is rolled out is divided into parts, and none is begun too late."""

from collections.abc import Iterator
from time import monotonic, perf_counter
from typing import Final

FIRST_PART: Final = 64  # sequences, until it is known how long they take
PART: Final = 256
RESERVE: Final = 0.004  # [s] before the deadline, for what comes after the search


class Pacing:
    """Measures how long sequences take, and how long an algorithm takes between its rounds."""

    def __init__(self, deadline: float | None) -> None:
        """Keep this `time.monotonic`; None: there is no hurry."""
        self._deadline = deadline
        self._pace = 0.0  # [s] a sequence, at most so far
        self._between = 0.0  # [s], longest from one round to the next
        self._idle_since = perf_counter()

    @property
    def over(self) -> bool:
        """Whether there is no time left for another round."""
        return self._late(self._between + FIRST_PART * self._pace)

    def parts(self, count: int) -> Iterator[slice]:
        """Yield parts of a round: one, or under a deadline as many as there is time for.

        The first is small, and always there: whether there is time for it, `over` tells.
        """
        self._between = max(self._between, perf_counter() - self._idle_since)
        start = 0
        while start < count:
            size = self._size(count, start)
            if start and self._late(size * self._pace):
                break
            begun = perf_counter()
            yield slice(start, start + size)
            start += size
            self._pace = max(self._pace, (perf_counter() - begun) / size)
        self._idle_since = perf_counter()

    def _size(self, count: int, start: int) -> int:
        if self._deadline is None:
            return count
        hurried = not start or self._late(PART * self._pace)
        return min(FIRST_PART if hurried else PART, count - start)

    def _late(self, needed: float) -> bool:
        """Tell whether so many seconds more are too many."""
        return self._deadline is not None and monotonic() + needed + RESERVE > self._deadline
