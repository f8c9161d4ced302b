"""A set of numbers that are mostly counted up: it remembers ranges, not numbers."""

from bisect import bisect_right


class IdRanges:
    """A growing set of integers; what is counted up takes no memory however long it is."""

    def __init__(self) -> None:
        """Begin empty."""
        self._starts: list[int] = []
        self._ends: list[int] = []  # of the range that starts at the same place, inclusive

    def __contains__(self, number: int) -> bool:
        """Tell whether a number was added."""
        place = bisect_right(self._starts, number) - 1
        return place >= 0 and number <= self._ends[place]

    def __len__(self) -> int:
        """Return how many ranges are remembered."""
        return len(self._starts)

    def add(self, number: int) -> None:
        """Add a number; one that is there already changes nothing."""
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
