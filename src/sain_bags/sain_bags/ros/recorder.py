"""The node that records: it takes the bytes of every topic as they come, and looks at none.

It has no executor. What an executor does for each message, waiting on everything a node has and
making a task of each callback, costs far more than the message; here every topic is emptied in
turn, a hundred times a second. The middleware keeps what comes in between, and when it came.
"""

import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any, Final

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_bags.bag.definitions import Definitions
from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.ros.endpoints import message_class, offered_qos, qos_profile
from sain_bags.writing.gaps import Gaps
from sain_bags.writing.selection import Selection, adapt
from sain_bags.writing.writer import BagWriter
from sain_core.errors import InvalidInputError

DISCOVERY_PERIOD: Final = 0.05  # [s] between looks for new topics
REVISION_PERIOD: Final = 1.0  # [s] between looks at all publishers, also where their number stays
ABSENCE_TIME: Final = 5.0  # [s], after which a topic that was asked for is warned of
TAKEN_AT_ONCE: Final = 500  # messages of a topic before the others have their turn
SEEN: Final = 1000  # messages of a topic that are known again: as many as any is latched for
ENTITIES: Final = {  # of every node; it publishes nothing that needs a description
    "start_type_description_service": False,
}


@dataclass
class Recorded:
    """One topic that is recorded."""

    topic: Topic
    message_class: type  # to subscribe with
    gaps: Gaps
    wanted: TopicQos | None = None
    subscription: Subscription | None = None
    seen: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=SEEN))
    """The latest messages, by number and time."""
    repeated: frozenset[tuple[int, int]] = frozenset()
    """Those that the subscription before had seen."""


class Recorder(Node):
    """Subscribes to topics as they appear, and writes their bytes as they come."""

    def __init__(self, writer: BagWriter, selection: Selection, **options: Any) -> None:
        """Record with a writer that the caller closes; `work` does it all."""
        overrides = [Parameter(name, value=value) for name, value in ENTITIES.items()]
        super().__init__(
            "recorder", parameter_overrides=overrides, start_parameter_services=False, **options
        )
        self.unusable: dict[str, str] = {}  # topics that cannot be recorded, and why
        self._writer = writer
        self._selection = selection
        self._definitions = Definitions()
        self._recorded: dict[str, Recorded] = {}
        self._known_publishers: dict[str, set[bytes]] = {}  # that ever were, by topic
        self._counts: dict[str, int] = {}  # of publishers, when last looked
        self._next_look = self._next_revision = 0.0
        self._absence_at: float | None = time.monotonic() + ABSENCE_TIME  # None: it was warned of

    @property
    def gaps(self) -> dict[str, Gaps]:
        """What is missing, by topic."""
        return {name: recorded.gaps for name, recorded in self._recorded.items()}

    @property
    def awaited(self) -> set[str]:
        """Topics that were asked for by name, and that nobody publishes yet."""
        return set(self._selection.chosen) - {*self._recorded, *self.unusable}

    @property
    def unmatched(self) -> list[str]:
        """Topics with a publisher that this node is not connected with yet."""
        recorded = self._recorded.items()
        return [name for name, one in recorded if _matched(one) < self.count_publishers(name)]

    def work(self) -> int:
        """Look for topics if it is time, write what has come, flush if it is time.

        Returns:
            messages that were written.

        Raises:
            OutputError: the disk is full, nearly full or failed.
        """
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + DISCOVERY_PERIOD
            self.discover()
        taken = sum([self._take(recorded) for recorded in self._recorded.values()])
        self._writer.flush_if_due()
        return taken

    def discover(self) -> None:
        """Take on topics that are new, and adapt to publishers that are."""
        now = time.monotonic()
        is_revision = now >= self._next_revision
        if is_revision:
            self._next_revision = now + REVISION_PERIOD
        if self._absence_at is not None and now >= self._absence_at:
            self._absence_at = None
            for name in sorted(self.awaited):
                self.get_logger().warning(f"{name} was asked for, and nobody publishes it")
        for name, types in self.get_topic_names_and_types():
            if not self._selection.wants(name, types):
                continue
            count = self.count_publishers(name)
            if is_revision or count != self._counts.get(name, 0):
                self._look_at(name, types)

    def _look_at(self, name: str, types: list[str]) -> None:
        publishers = self.get_publishers_info_by_topic(name)
        self._counts[name] = len(publishers)
        if not publishers:
            return
        self._count_publishers(name, publishers)
        try:
            self._take_on(name, types, publishers)
        except InvalidInputError as error:
            if name not in self.unusable:
                self.get_logger().warning(f"{name} is not recorded: {error}")
            self.unusable[name] = str(error)

    def _take_on(self, name: str, types: list[str], publishers: list[TopicEndpointInfo]) -> None:
        offers = tuple(offered_qos(info) for info in publishers)
        known, publisher_count = self._recorded.get(name), len(self._known_publishers[name])
        # Profiles of publishers that are gone stay on record: their messages do, too.
        merged = tuple(dict.fromkeys((*(known.topic.offered_qos if known else ()), *offers)))
        if known is None:
            kind = _only(types)
            found, definition = message_class(kind), self._definitions.joined(kind)
            # Readers take a service's types by other names than these, and find other hashes.
            type_hash = "" if "/srv/" in kind else str(publishers[0].topic_type_hash)
            topic = Topic(name, kind, definition, type_hash, merged, publisher_count)
            gaps = Gaps(lambda: self._count_publishers(name))
            known = self._recorded[name] = Recorded(topic, found, gaps)
            self._writer.add_topic(topic)
            self.unusable.pop(name, None)
        topic = replace(known.topic, offered_qos=merged, publishers=publisher_count)
        if topic != known.topic:
            self._writer.add_topic(topic)
            known.topic = topic
        wanted = adapt(offers)
        if known.wanted != wanted:
            self._subscribe(known, wanted)

    def _subscribe(self, recorded: Recorded, wanted: TopicQos) -> None:
        name, former = recorded.topic.name, recorded.subscription
        subscription = self.create_subscription(
            recorded.message_class, name, _unused, qos_profile(wanted), raw=True
        )
        if former is not None:
            while self._take(recorded):
                pass
            self.destroy_subscription(former)
            recorded.repeated = frozenset(recorded.seen)
        recorded.subscription, recorded.wanted = subscription, wanted

    def _count_publishers(
        self, name: str, publishers: list[TopicEndpointInfo] | None = None
    ) -> int:
        """Return how many publishers a topic ever had."""
        found = self.get_publishers_info_by_topic(name) if publishers is None else publishers
        known = self._known_publishers.setdefault(name, set())
        known.update(bytes(info.endpoint_gid) for info in found)
        return len(known)

    def _take(self, recorded: Recorded) -> int:
        """Write what has come of a topic; return how much that was."""
        if recorded.subscription is None:
            return 0
        name, gaps, write = recorded.topic.name, recorded.gaps, self._writer.write
        saw, repeated = recorded.seen.append, recorded.repeated
        handle, kind = recorded.subscription.handle, recorded.subscription.msg_type
        taken = 0
        with handle:
            while taken < TAKEN_AT_ONCE and (found := handle.take_message(kind, True)) is not None:
                data, about = found
                published = about["source_timestamp"]
                sequence = about["publication_sequence_number"] or 0
                if repeated and (sequence, published) in repeated:
                    continue  # who subscribes anew is given again what is latched
                saw((sequence, published))
                gaps.saw(sequence)
                received = about["received_timestamp"] or time.time_ns()
                write(name, data, received, published, sequence)
                taken += 1
        return taken


def _matched(recorded: Recorded) -> int:
    subscription = recorded.subscription
    return 0 if subscription is None else subscription.get_publisher_count()


def _only(types: list[str]) -> str:
    if len(types) > 1:
        raise InvalidInputError(f"it has several types: {', '.join(types)}")
    return types[0]


def _unused(message: bytes) -> None:
    """Never called: messages are taken, and not waited for."""
