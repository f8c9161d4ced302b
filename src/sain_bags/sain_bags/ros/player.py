"""The node that plays: offers topics as their publishers did, and publishes recorded bytes."""

import time
from typing import Any, Final

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from sain_bags.bag.metadata import read_profiles
from sain_bags.playing import CLOCK, Event, merge_offers, place_in
from sain_bags.reading.reader import TopicSummary
from sain_bags.ros.endpoints import message_class, qos_profile
from sain_core.errors import DatasetError, InvalidInputError

PARTING: Final = 2.0  # [s], for what was sent last to arrive


class Player(Node):
    """Plugins topics as their publishers did, and publishes bytes on them."""

    def __init__(self, topics: tuple[TopicSummary, ...], namespace: str, **options: Any) -> None:
        """Offer what can be offered here; the others are warned of."""
        super().__init__("player", start_parameter_services=False, **options)
        self._offered: dict[tuple[str, str], Publisher] = {}
        self.latched: dict[str, int] = {}
        for topic in topics:
            try:
                self._offer(topic, place_in(namespace, topic.name))
            except InvalidInputError as error:
                self.get_logger().warning(f"{topic.name} is not played: {error}")
        if not self._offered:
            raise DatasetError("nothing is left to play: no topic's type can be published here")
        self._clock_publisher: Publisher | None = None

    @property
    def topics(self) -> frozenset[str]:
        """The recorded names of the topics that are played."""
        return frozenset(name for name, _ in self._offered)

    def offer_clock(self) -> None:
        """Offer /clock, for the times that the bag does not hold as messages."""
        self._clock_publisher = self.create_publisher(Clock, CLOCK, 10)

    def unheard(self) -> list[str]:
        """Return the names of topics that nobody subscribes to."""
        return [
            publisher.topic_name
            for publisher in self._offered.values()
            if not publisher.get_subscription_count()
        ]

    def publish(self, event: Event) -> None:
        """Publish one message, or the time."""
        if event.raw is not None:
            publisher = self._offered.get((event.raw.topic, event.raw.type))
            if publisher is not None:
                publisher.publish(bytes(event.raw.data))
        elif self._clock_publisher is not None:
            seconds, nanoseconds = divmod(event.time, 10**9)
            self._clock_publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))

    def let_arrive(self) -> None:
        """Wait until subscribers have what was sent last."""
        end = time.monotonic() + PARTING
        for publisher in self._offered.values():
            left = max(end - time.monotonic(), 0.0)
            publisher.wait_for_all_acked(Duration(nanoseconds=round(1e9 * left)))

    def _offer(self, topic: TopicSummary, name: str) -> None:
        if topic.type.count("/") != 2 or "/msg/" not in topic.type:
            raise InvalidInputError(f"{topic.type or 'without a type, it'} is no message")
        offer = merge_offers(read_profiles(topic.offered_qos))
        kind = message_class(topic.type)
        try:
            publisher = self.create_publisher(kind, name, qos_profile(offer))
        except NameValidationException as error:
            raise InvalidInputError(f"{name} is no topic's name") from error
        here = self._type_hash(publisher.topic_name)
        if topic.type_hash and here and topic.type_hash != here:
            self.destroy_publisher(publisher)
            raise InvalidInputError(
                f"{topic.type} is another one here than in the bag ({here}, {topic.type_hash})"
            )
        self._offered[topic.name, topic.type] = publisher
        if offer.durability == "transient_local":
            self.latched[topic.name] = offer.depth

    def _type_hash(self, name: str) -> str:
        """Return the hash of the type that this node publishes there; empty: not known."""
        for info in self.get_publishers_info_by_topic(name):
            if (info.node_name, info.node_namespace) == (self.get_name(), self.get_namespace()):
                return str(info.topic_type_hash)
        return ""
