"""When the messages of each topic came: how often, the longest silence, and how many never came."""

from dataclasses import dataclass

from mcap.records import Channel, Message

from sain_bags.reading.reader import Bag


@dataclass(frozen=True)
class TopicTiming:
    """One topic's messages, in the order of the file."""

    rate: float  # [Hz] between the first and the last, 0: not known
    longest_gap: float  # [s] between two messages, 0: there are no two
    missing: int | None  # numbers that its publisher gave and that are not there; None: not known


@dataclass
class _Progress:
    messages: int = 0
    first: int = 0  # [ns since the epoch]
    last: int = 0
    longest: int = 0  # [ns]
    sequence: int = 0
    published: int = 0  # [ns since the epoch]
    missing: int | None = 0

    def saw(self, message: Message) -> None:
        if self.messages and message.sequence == self.sequence and self._is_repeated(message):
            return
        if self.messages:
            self.longest = max(self.longest, message.log_time - self.last)
            self._count(message.sequence)
        else:
            self.first = message.log_time
            self.missing = 0 if message.sequence else None
        self.messages += 1
        self.last, self.sequence = message.log_time, message.sequence
        self.published = message.publish_time

    def _is_repeated(self, message: Message) -> bool:
        """Tell whether it is what a latched topic held, again at the head of a later file."""
        return bool(message.sequence) and message.publish_time == self.published

    def _count(self, sequence: int) -> None:
        # Numbers of several publishers run side by side, so that gaps cannot be counted.
        if self.missing is None or sequence <= self.sequence:
            self.missing = None
        else:
            self.missing += sequence - self.sequence - 1

    def timing(self) -> TopicTiming:
        duration = 1e-9 * (self.last - self.first)
        rate = (self.messages - 1) / duration if duration > 0 else 0.0
        return TopicTiming(rate, 1e-9 * self.longest, self.missing)


def read_timings(bag: Bag) -> dict[str, TopicTiming]:
    """Read the whole bag, comparing every CRC, and return the timing of each topic with messages.

    Raises:
        DatasetError: a bit is not as it was written.
    """
    names: dict[int, str] = {}
    topics: dict[str, _Progress] = {}
    for record in bag.records():
        if isinstance(record, Channel):
            names[record.id] = record.topic
        elif isinstance(record, Message):
            topics.setdefault(names[record.channel_id], _Progress()).saw(record)
    return {name: progress.timing() for name, progress in topics.items()}
