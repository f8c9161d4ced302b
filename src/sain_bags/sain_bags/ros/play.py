"""``ros2 run sain_bags play``: publishes a bag's messages again, byte by byte, in their time."""

import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event as Flag
from types import FrameType
from typing import Any, Final

import rclpy
import tyro
from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from rosgraph_msgs.msg import Clock

from sain_bags.metadata import OfferedQos, read_profiles
from sain_bags.playing import (
    CLOCK,
    Event,
    Passage,
    PassageConfig,
    Played,
    choose_topics,
    merge_offers,
    place_in,
    play,
)
from sain_bags.reader import Bag, TopicSummary
from sain_bags.ros.endpoints import message_class
from sain_core.command_line import describe_options
from sain_core.errors import DatasetError, InvalidInputError, SainError

LOOK: Final = 0.02  # [s], between two looks for subscribers
SHOWN: Final = 0.2  # [s], between two looks at the bar
PARTING: Final = 2.0  # [s], for what was sent last to arrive


@dataclass(frozen=True)
class PlayOptions:
    """Play a bag: publish its messages again as they were recorded, in their time.

    Ctrl-C ends it. Topics are renamed with --ros-args -r /from:=/to.
    """

    bag: tyro.conf.Positional[Path]
    """A bag's folder, or its MCAP file."""
    topics: tuple[str, ...] = ()
    """Topics to play, with their full names; none: all but /parameter_events."""
    namespace: str = ""
    """Put before every topic's name, /clock aside."""
    wait: float = 1.0
    """Wait at most so long until every topic has a subscriber [s]."""
    passage: PassageConfig = field(default_factory=PassageConfig)


class Player(Node):
    """Offers topics as their publishers did, and publishes bytes on them."""

    def __init__(self, topics: tuple[TopicSummary, ...], namespace: str, **options: Any) -> None:
        """Offer what can be offered here; the others are warned of.

        Raises:
            DatasetError: none can.
        """
        super().__init__("player", **options)
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self.latched: dict[str, int] = {}
        for topic in topics:
            try:
                self._offer(topic, place_in(namespace, topic.name))
            except InvalidInputError as error:
                self.get_logger().warning(f"{topic.name} is not played: {error}")
        if not self._publishers:
            raise DatasetError("nothing is left to play: no topic's type can be published here")
        self._clock_publisher: Publisher | None = None

    @property
    def topics(self) -> frozenset[str]:
        """The recorded names of the topics that are played."""
        return frozenset(name for name, _ in self._publishers)

    def offer_clock(self) -> None:
        """Offer /clock, for the times that the bag does not hold as messages."""
        self._clock_publisher = self.create_publisher(Clock, CLOCK, 10)

    def unheard(self) -> list[str]:
        """Return the names of topics that nobody subscribes to."""
        return [
            publisher.topic_name
            for publisher in self._publishers.values()
            if not publisher.get_subscription_count()
        ]

    def publish(self, event: Event) -> None:
        """Publish one message, or the time."""
        if event.raw is not None:
            publisher = self._publishers.get((event.raw.topic, event.raw.type))
            if publisher is not None:
                publisher.publish(bytes(event.raw.data))
        elif self._clock_publisher is not None:
            seconds, nanoseconds = divmod(event.time, 10**9)
            self._clock_publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))

    def let_arrive(self) -> None:
        """Wait until subscribers have what was sent last."""
        end = time.monotonic() + PARTING
        for publisher in self._publishers.values():
            left = max(end - time.monotonic(), 0.0)
            publisher.wait_for_all_acked(Duration(nanoseconds=round(1e9 * left)))

    def _offer(self, topic: TopicSummary, name: str) -> None:
        if topic.type.count("/") != 2 or "/msg/" not in topic.type:
            raise InvalidInputError(f"{topic.type or 'without a type, it'} is no message")
        offer = merge_offers(read_profiles(topic.offered_qos))
        publisher = self.create_publisher(message_class(topic.type), name, offer_profile(offer))
        here = self._type_hash(publisher.topic_name)
        if topic.type_hash and here and topic.type_hash != here:
            self.destroy_publisher(publisher)
            raise InvalidInputError(
                f"{topic.type} is another one here than in the bag ({here}, {topic.type_hash})"
            )
        self._publishers[topic.name, topic.type] = publisher
        if offer.durability == "transient_local":
            self.latched[topic.name] = offer.depth

    def _type_hash(self, name: str) -> str:
        """Return the hash of the type that this node publishes there; empty: it is not told."""
        for info in self.get_publishers_info_by_topic(name):
            if (info.node_name, info.node_namespace) == (self.get_name(), self.get_namespace()):
                return str(info.topic_type_hash)
        return ""


def offer_profile(offer: OfferedQos) -> QoSProfile:
    """Return rclpy's words for a profile."""
    keep_all, latched = offer.history == "keep_all", offer.durability == "transient_local"
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if keep_all else HistoryPolicy.KEEP_LAST,
        depth=offer.depth,
        reliability=(
            ReliabilityPolicy.BEST_EFFORT
            if offer.reliability == "best_effort"
            else ReliabilityPolicy.RELIABLE
        ),
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        ),
        deadline=_duration(offer.deadline),
        lifespan=_duration(offer.lifespan),
        liveliness=(
            LivelinessPolicy.MANUAL_BY_TOPIC
            if offer.liveliness == "manual_by_topic"
            else LivelinessPolicy.AUTOMATIC
        ),
        liveliness_lease_duration=_duration(offer.liveliness_lease_duration),
    )


def _duration(value: tuple[int, int]) -> Duration:
    return Duration(nanoseconds=min(value[0] * 10**9 + value[1], 2**63 - 1))


class Watch:
    """Monotonic time, and an end that a signal asks for."""

    def __init__(self) -> None:
        """Take over SIGINT and SIGTERM."""
        self._end = Flag()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic()

    def wait(self, seconds: float) -> bool:
        """Wait so long, or until a signal; tell whether one came."""
        return self._end.wait(seconds) if seconds > 0.0 else self._end.is_set()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._end.set()


def run(options: PlayOptions, console: Console) -> Played:
    """Play a bag to its end or until a signal comes.

    Raises:
        DatasetError: the bag is damaged, or there is nothing in it that can be played.
    """
    watch, bag = Watch(), Bag(options.bag)
    chosen = choose_topics(bag, options.topics, options.passage.clock > 0.0)
    player = Player(chosen, options.namespace)
    try:
        passage = Passage(bag, player.topics, options.passage, player.latched)
        if options.passage.clock and CLOCK not in player.topics:
            player.offer_clock()
        await_subscribers(player, options.wait, watch)
        played = _play_with_bar(passage, player, watch, options, console)
        player.let_arrive()
    finally:
        player.destroy_node()
    return played


def await_subscribers(player: Player, patience: float, watch: Watch) -> None:
    """Wait until every topic has a subscriber, not longer than patience allows [s]."""
    end = watch.now() + patience
    while player.unheard() and watch.now() < end and not watch.wait(LOOK):
        pass


def _play_with_bar(
    passage: Passage, player: Player, watch: Watch, options: PlayOptions, console: Console
) -> Played:
    columns = (
        TextColumn("play"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s, {task.fields[messages]:,} messages"),
    )
    with Progress(*columns, console=console, transient=True, refresh_per_second=5) as bar:
        task = bar.add_task("play", total=passage.duration, messages=0)
        shown, messages = 0.0, 0

        def publish(event: Event) -> None:
            nonlocal shown, messages
            player.publish(event)
            messages += event.raw is not None
            if (now := watch.now()) > shown + SHOWN:
                shown = now
                bar.update(task, completed=_place(event, passage), messages=messages)

        return play(passage.events(), publish, watch)


def _place(event: Event, passage: Passage) -> float:
    """Return how far into the passage an event is [s], in whichever time through it."""
    return event.due % passage.duration if event.due > passage.duration > 0.0 else event.due


def main() -> None:
    """Run from the command line."""
    describe_options(PassageConfig)
    console = Console(soft_wrap=True)
    try:
        options = tyro.cli(
            PlayOptions,
            prog="ros2 run sain_bags play",
            args=remove_ros_args(sys.argv)[1:],
            config=(tyro.conf.OmitArgPrefixes,),
        )
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        played = run(options, console)
    except SainError as error:
        Console(stderr=True, soft_wrap=True).print(
            f"play: {error}", style="red", highlight=False, markup=False
        )
        sys.exit(1)
    finally:
        rclpy.try_shutdown()
    late = f", at most {1e3 * played.late:.1f} ms late" if played.messages else ""
    state = "Stopped after" if played.stopped else "Played"
    console.print(f"{state} {played.messages:,} messages{late}", highlight=False)


if __name__ == "__main__":
    main()
