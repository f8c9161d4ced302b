"""A set of numbers that are mostly counted up: it remembers ranges, not numbers."""

from bisect import bisect_left, bisect_right

import numpy as np
from numpy import ndarray


class IdRanges:
    """A growing set of integers; what is counted up takes no memory however long it is."""

    def __init__(self) -> None:
        """Begin empty."""
        self._starts: list[int] = []
        self._ends: list[int] = []  # of the range that starts at the same place, inclusive

    def __contains__(self, number: int) -> bool:
        """Tell whether a number was added."""
        if not self._ends or number > self._ends[-1]:  # as one that is counted up mostly is
            return False
        place = bisect_right(self._starts, number) - 1
        return place >= 0 and number <= self._ends[place]

    def holds(self, numbers: ndarray) -> ndarray:
        """Tell which numbers (M,) were added."""
        starts, ends = (np.array(found, dtype=np.uint64) for found in (self._starts, self._ends))
        place = np.searchsorted(starts, numbers, side="right")
        return (place > 0) & (numbers <= np.append(ends, np.uint64(0))[place - 1])

    def __len__(self) -> int:
        """Return how many ranges are remembered."""
        return len(self._starts)

    def add(self, first: int, last: int | None = None) -> None:
        """Add a number, or all from the first to the last; what is there already stays."""
        last = first if last is None else last
        # The ranges from `low` up to `high` overlap the new one or adjoin it.
        low = bisect_left(self._ends, first - 1)
        high = bisect_right(self._starts, last + 1)
        if low < high:
            first, last = min(first, self._starts[low]), max(last, self._ends[high - 1])
        self._starts[low:high] = [first]
        self._ends[low:high] = [last]

    def add_all(self, numbers: ndarray) -> None:
        """Add numbers (M,)."""
        ordered = np.sort(numbers)
        breaks = np.flatnonzero(ordered[1:] - ordered[:-1] > 1) + 1
        for run in np.split(ordered, breaks):
            self.add(int(run[0]), int(run[-1]))
