"""When the messages of each topic came, how late, and how many never came."""

from dataclasses import dataclass, field
from typing import Final

from sain_bags.reading.bag_files import NEVER
from sain_bags.reading.reader import Bag, Raw

BINS: Final = 120  # that a recording's time is cut into
LATCHED: Final = "transient_local"  # of a topic whose messages each file repeats
PLACES: Final = 200  # of missing messages, listed one by one


@dataclass
class TopicTiming:
    """One topic's messages over the time of the recording."""

    counts: list[int] = field(default_factory=lambda: [0] * BINS)  # messages in each bin
    messages: int = 0
    first: int = 0  # [ns since the epoch]
    last: int = 0
    longest_gap: float = 0.0  # [s] between two messages, 0: there are no two
    gap_start: int = 0  # [ns since the epoch]
    missing: int | None = 0  # numbers that its publisher gave and that never came; None: not known
    latest: float = 0.0  # [s] from publication to receipt, the longest; 0: not known
    places: list[tuple[int, int]] = field(default_factory=list)  # [ns since the epoch], how many
    _sequence: int = 0
    _published: int = 0  # [ns since the epoch]

    @property
    def rate(self) -> float:
        """Messages a second between the first and the last [Hz], 0: not known."""
        duration = 1e-9 * (self.last - self.first)
        return (self.messages - 1) / duration if duration > 0 else 0.0

    def saw(self, message: Raw, place: int, began: int = 0) -> None:
        """Count a message in the bin of this place, but not one that was seen before: a latched
        topic's, repeated at the head of a later file.

        One that was published before the recording began [ns since the epoch] is not late.
        """
        time, number = message.log_time, message.sequence
        known = (self._sequence, self._published)
        if self.messages and number and (number, message.publish_time) == known:
            return
        if self.messages:
            if (gap := 1e-9 * (time - self.last)) > self.longest_gap:
                self.longest_gap, self.gap_start = gap, self.last
            self._count(time, number)
        else:
            self.first = time
            self.missing = 0 if number else None
        if message.publish_time >= began:
            self.latest = max(self.latest, 1e-9 * (time - message.publish_time))
        self.messages += 1
        self.counts[place] += 1
        self.last, self._sequence, self._published = time, number, message.publish_time

    def _count(self, log_time: int, sequence: int) -> None:
        # Numbers of several publishers run side by side, so that gaps cannot be counted.
        if self.missing is None or sequence <= self._sequence:
            self.missing, self.places = None, []
        elif lost := sequence - self._sequence - 1:
            self.missing += lost
            if len(self.places) < PLACES:
                self.places.append((log_time, lost))


def read_timings(bag: Bag) -> dict[tuple[str, str], TopicTiming]:
    """Read the whole bag, comparing each chunk with its CRC; return timings by topic and type."""
    span = max(1, round(1e9 * bag.duration) + 1)
    timings = {(topic.name, topic.type): TopicTiming() for topic in bag.topics}
    start = bag.start
    repeats = {one.name for one in bag.topics if LATCHED in one.offered_qos and len(bag.files) > 1}
    for raw in bag.raw_messages():
        place = (raw.log_time - start) * BINS // span
        timings[raw.topic, raw.type].saw(
            raw, min(max(place, 0), BINS - 1), NEVER if raw.topic in repeats else start
        )
    return timings
