"""When each message of a bag is due when it is played again, and the playing itself. No ROS here.

Everything is scheduled from the start of the playing, by log time divided by the rate, so that no
delay adds up.
"""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import merge
from itertools import count
from pathlib import Path
from typing import Final, Protocol, runtime_checkable

import tyro

from sain_bags.bag.metadata import TopicQos
from sain_bags.reading.reader import BAG_HELP, Bag, Raw, TopicSummary
from sain_core.config import Config, option, required
from sain_core.errors import DatasetError

CLOCK: Final = "/clock"
CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
NEVER: Final = frozenset({"/parameter_events"})  # of nodes that are no more; played if asked for
DEPTH: Final = 10  # where it was not recorded; discovery does not tell it
REST: Final = 1_000_000_000  # [ns], from one time to the next of what has no duration


@dataclass(frozen=True)
class PlayOptions(Config):
    """Play a bag: publish its messages again as they were recorded, at the recorded times.

    Ctrl-C ends it. Topics are renamed with --ros-args -r /from:=/to.
    """

    bag: tyro.conf.Positional[Path] = required(BAG_HELP)
    topics: tuple[str, ...] = option(
        (), "topics to play, with their full names; none: all but /parameter_events"
    )
    namespace: str = option("", "prefix of every topic's name except /clock")
    wait: float = option(
        1.0, "longest wait until every topic has a subscriber", unit="s", minimum=0.0
    )
    rate: float = option(1.0, "recorded time / playing time", minimum=1e-3, maximum=1e3)
    start: float = option(0.0, "start, from the beginning of the recording", unit="s", minimum=0.0)
    duration: float = option(0.0, "length of the played part; 0: to the end", unit="s", minimum=0.0)
    loop: bool = option(False, "begin again at the end, until Ctrl-C")
    clock: float = option(
        0.0,
        "rate of /clock from log times if none was recorded; 0: recorded only",
        unit="Hz",
        minimum=0.0,
        maximum=1e4,
    )


@dataclass(frozen=True)
class Event:
    """Something to publish: a message, or the time."""

    due: float  # [s] from the start of the playing
    time: int  # [ns since the epoch], log time
    raw: Raw | None  # None: it is the time


class Passage:
    """A part of a bag as a timetable."""

    def __init__(
        self,
        bag: Bag,
        topics: Collection[str],
        options: PlayOptions,
        latched: Mapping[str, int] | None = None,
    ) -> None:
        """Plan to play topics, by their full names.

        `latched` has the number of messages that late joiners get of a topic. Those that came
        before the start are played at the start.

        Raises:
            DatasetError: nothing of the bag lies in that part.
        """
        if not bag.message_count:
            raise DatasetError(f"{bag.path} holds no messages to play")
        if options.start > bag.duration:
            raise DatasetError(
                f"{bag.path} is {bag.duration:.3f} s long; it cannot be played"
                f" from {options.start:.3f} s on"
            )
        self._bag, self._topics, self._options = bag, frozenset(topics), options
        self._latched = dict(latched or {})
        self.first = bag.start + round(1e9 * options.start)  # [ns since the epoch]
        end = bag.start + round(1e9 * bag.duration)
        if options.duration:
            end = min(end, self.first + round(1e9 * options.duration))
        self.last = end

    @property
    def duration(self) -> float:
        """Of one time through it [s], as it is played."""
        return 1e-9 * (self.last - self.first) / self._options.rate

    def events(self) -> Iterator[Event]:
        """Yield what is due, in that order; without an end when it is played in a loop."""
        again = max(self.last - self.first, REST if self.last == self.first else 0)
        for number in count() if self._options.loop else (0,):
            before = number * 1e-9 * again / self._options.rate
            timetable = merge(self._ticks(), self._once(), key=lambda event: event.due)
            for event in timetable:
                yield replace(event, due=before + event.due)

    def _once(self) -> Iterator[Event]:
        # Each later file of a split bag repeats the messages of latched topics.
        sent: set[tuple[str, int, int]] = set()
        for raw in self._kept():
            sent.add((raw.topic, raw.publish_time, raw.sequence))
            yield Event(0.0, self.first, raw)
        for raw in self._bag.raw_messages(self._topics, self.first):
            if raw.log_time > self.last:
                return
            if raw.topic in self._latched:
                key = (raw.topic, raw.publish_time, raw.sequence)
                if key in sent:
                    continue
                sent.add(key)
            yield Event(self._due(raw.log_time), raw.log_time, raw)

    def _due(self, time: int) -> float:
        return 1e-9 * (time - self.first) / self._options.rate

    def _kept(self) -> list[Raw]:
        """Return what a late joiner would have got at the start."""
        kept = {topic: deque[Raw](maxlen=depth) for topic, depth in self._latched.items()}
        if self.first > self._bag.start and kept:
            for raw in self._bag.raw_messages(frozenset(kept)):
                if raw.log_time >= self.first:
                    break
                kept[raw.topic].append(raw)
        return sorted((raw for topic in kept.values() for raw in topic), key=lambda r: r.log_time)

    def _ticks(self) -> Iterator[Event]:
        """Yield the times of /clock, where it is wanted and not among the messages."""
        if not self._options.clock or CLOCK in self._topics:
            return
        step = 1e9 * self._options.rate / self._options.clock  # [ns] of the recording
        for number in count():
            if (time := self.first + round(number * step)) > self.last:
                return
            yield Event(self._due(time), time, None)


@runtime_checkable
class Pulse(Protocol):
    """A clock to play by."""

    def now(self) -> float:
        """Return a time that only goes forward [s]."""

    def wait(self, seconds: float) -> bool:
        """Wait so long, or until the end is asked for; tell whether it is."""


@dataclass
class Played:
    """How a playing went."""

    messages: int = 0
    late: float = 0.0  # [s], the longest that something came after it was due
    stopped: bool = False  # before its end


def play(events: Iterator[Event], publish: Callable[[Event], object], pulse: Pulse) -> Played:
    """Publish each event when it is due; what is overdue at once."""
    played, began = Played(), pulse.now()
    for event in events:
        if pulse.wait(max(began + event.due - pulse.now(), 0.0)):
            played.stopped = True
            break
        played.late = max(played.late, pulse.now() - began - event.due)
        publish(event)
        played.messages += event.raw is not None
    return played


def choose_topics(
    bag: Bag, wanted: Collection[str], clock: bool = False
) -> tuple[TopicSummary, ...]:
    """Return the topics to play: those that are wanted, or all but `NEVER`."""
    names = {topic.name for topic in bag.topics}
    for name in wanted:
        if name not in names:
            raise DatasetError(f"{bag.path} has no topic {name}; it has {', '.join(sorted(names))}")
    recorded = any((topic.name, topic.type) == (CLOCK, CLOCK_TYPE) for topic in bag.topics)
    chosen = set(wanted) or names - NEVER
    if clock and recorded:
        chosen.add(CLOCK)
    return tuple(topic for topic in bag.topics if topic.name in chosen)


def merge_offers(offers: Sequence[TopicQos]) -> TopicQos:
    """Return one profile that serves every subscriber that one of a topic's publishers served."""
    latched = any(qos.durability == "transient_local" for qos in offers)
    lossy = offers and all(qos.reliability == "best_effort" for qos in offers)
    known = max((qos.depth for qos in offers), default=0)
    names = ("deadline", "lifespan", "liveliness", "liveliness_lease_duration")
    same = len({tuple(getattr(qos, name) for name in names) for qos in offers}) == 1
    return replace(
        offers[0] if same else TopicQos(),
        history="keep_all" if any(qos.history == "keep_all" for qos in offers) else "keep_last",
        depth=known or (max(len(offers), 1) if latched else DEPTH),
        reliability="best_effort" if lossy else "reliable",
        durability="transient_local" if latched else "volatile",
    )


def place_in(namespace: str, topic: str) -> str:
    """Return a topic's name below a namespace; /clock stays what it is to everyone."""
    inside = namespace.strip("/")
    return topic if not inside or topic == CLOCK else f"/{inside}{topic}"
