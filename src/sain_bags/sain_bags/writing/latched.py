"""The messages of latched topics, which each later file of a split bag repeats."""

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from sain_bags.bag.metadata import Topic

HELD_OF_SEVERAL: Final = 64  # messages, where it is not known which of several publishers' each is


class Held(NamedTuple):
    """One message that a late subscriber would receive."""

    sequence: int
    published: int  # [ns since the epoch]
    data: bytes


class Latched:
    """Remembers the last message of each latched topic, more of one with several publishers."""

    def __init__(self) -> None:
        """Begin without a topic."""
        self._topics: dict[str, deque[Held]] = {}

    def add(self, topic: Topic) -> None:
        """Add a topic if it is latched or ever was."""
        if topic.is_latched or topic.name in self._topics:
            depth = HELD_OF_SEVERAL if topic.publishers > 1 else 1
            self._topics[topic.name] = deque(self._topics.get(topic.name, ()), maxlen=depth)

    def of(self, topic: str) -> deque[Held] | None:
        """Return the messages of a topic, to append to; None: it is not latched."""
        return self._topics.get(topic)

    def __iter__(self) -> Iterator[tuple[str, Held]]:
        """Yield all messages, topic by topic, in the order of receipt."""
        for topic, messages in self._topics.items():
            for message in messages:
                yield topic, message
