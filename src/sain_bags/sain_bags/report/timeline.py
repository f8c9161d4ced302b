"""When each topic's messages came, coarse enough to be drawn, and where some are missing."""

from dataclasses import dataclass, field
from typing import Any, Final

from sain_bags.reading.reader import Bag

BINS: Final = 120  # that a recording's time is cut into
PLACES: Final = 200  # of missing messages, listed one by one


@dataclass
class Lane:
    """One topic's messages over the time of the recording."""

    counts: list[int] = field(default_factory=lambda: [0] * BINS)  # messages in each bin
    messages: int = 0
    first: int = 0  # [ns since the epoch]
    last: int = 0
    longest_gap: int = 0  # [ns] between two messages, where nothing came
    gap_start: int = 0  # [ns since the epoch]
    missing: int | None = 0  # numbers that never came; None: not known
    places: list[tuple[int, int]] = field(default_factory=list)  # [ns since the epoch], how many
    _sequence: int = 0
    _published: int = 0  # [ns since the epoch]

    def saw(self, log_time: int, sequence: int, published: int, place: int) -> None:
        """Count a message in the bin of this place, but not one that was seen before: a latched
        topic's, repeated at the head of a later file.
        """
        if (
            self.messages
            and sequence
            and (sequence, published) == (self._sequence, self._published)
        ):
            return
        if self.messages:
            if log_time - self.last > self.longest_gap:
                self.longest_gap, self.gap_start = log_time - self.last, self.last
            self._count(log_time, sequence)
        else:
            self.first = log_time
            self.missing = 0 if sequence else None
        self.messages += 1
        self.counts[place] += 1
        self.last, self._sequence, self._published = log_time, sequence, published

    @property
    def rate(self) -> float:
        """Messages a second between the first and the last [Hz], 0: not known."""
        duration = 1e-9 * (self.last - self.first)
        return (self.messages - 1) / duration if duration > 0 else 0.0

    def _count(self, log_time: int, sequence: int) -> None:
        # Numbers of several publishers run side by side, so that gaps cannot be counted.
        if self.missing is None or sequence <= self._sequence:
            self.missing, self.places = None, []
        elif lost := sequence - self._sequence - 1:
            self.missing += lost
            if len(self.places) < PLACES:
                self.places.append((log_time, lost))


def read_lanes(bag: Bag) -> dict[str, Lane]:
    """Read the whole bag, comparing each chunk with its CRC, and return the lane of each topic.

    Raises:
        DatasetError: a bit is not as it was written.
    """
    span = max(1, round(1e9 * bag.duration) + 1)
    lanes = {topic.name: Lane() for topic in bag.topics}
    start = bag.start
    for raw in bag.raw_messages():
        place = (raw.log_time - start) * BINS // span
        place = min(max(place, 0), BINS - 1)
        lanes[raw.topic].saw(raw.log_time, raw.sequence, raw.publish_time, place)
    return lanes


def describe_lane(lane: Lane, start: int) -> dict[str, Any]:
    """Return what the page says of a lane; times are seconds from the start of the recording."""
    return {
        "messages": lane.messages,
        "rate": lane.rate,
        "counts": lane.counts,
        "gap": 1e-9 * lane.longest_gap,
        "gapStart": 1e-9 * (lane.gap_start - start) if lane.longest_gap else 0.0,
        "missing": lane.missing,
        "places": [[1e-9 * (time - start), count] for time, count in lane.places],
    }
