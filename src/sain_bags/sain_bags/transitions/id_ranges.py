"""A set of numbers that are mostly counted up: it remembers ranges, not numbers."""

from bisect import bisect_right

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

    def add(self, number: int) -> None:
        """Add a number; one that is there already changes nothing."""
        if self._ends and number == self._ends[-1] + 1:
            self._ends[-1] = number
            return
        if number in self:
            return
        place = bisect_right(self._starts, number)
        if place and self._ends[place - 1] == number - 1:
            self._ends[place - 1] = number
            place -= 1
        else:
            self._starts.insert(place, number)
            self._ends.insert(place, number)
        if place + 1 < len(self._starts) and self._starts[place + 1] == self._ends[place] + 1:
            self._ends[place] = self._ends.pop(place + 1)
            del self._starts[place + 1]

    def add_all(self, numbers: ndarray) -> None:
        """Add numbers (M,), none of which is there yet."""
        ordered = np.sort(numbers)
        breaks = np.flatnonzero(ordered[1:] - ordered[:-1] != 1) + 1
        for run in np.split(ordered, breaks):
            first, last = int(run[0]), int(run[-1])
            self.add(first)
            if last > first:
                self._ends[bisect_right(self._starts, first) - 1] = last - 1
                self.add(last)
