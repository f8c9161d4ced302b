"""``ros2 run sain_bags record``: records topics to a bag, those that appear late too."""

import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, Final

import rclpy
import tyro
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.utilities import remove_ros_args
from rich.console import Console

from sain_bags.definitions import Definitions
from sain_bags.metadata import Topic
from sain_bags.ros.endpoints import message_class, offered_qos, request_profile
from sain_bags.selection import RequestedQos, adapt, is_wanted
from sain_bags.writer import BagConfig, BagWriter
from sain_core.errors import ConfigError, InvalidInputError, SainError

DISCOVERY_PERIOD: Final = 0.05  # [s], also how soon a signal is noticed
DRAIN_TIME: Final = 0.5  # [s], at most, for messages that have come before the stop
QUIET_TIME: Final = 0.05  # [s] without a message: nothing more is on its way ...
QUIET_LOOKS: Final = (
    10  # ... if this often nothing was there: time passes for a halted process, too
)


@dataclass(frozen=True)
class RecordOptions:
    """Record a running graph to a bag (rosbag2 layout, MCAP).

    All topics are recorded, also those that appear later, with the definitions of their messages.
    Ctrl-C ends the recording and makes the bag whole.
    """

    out: Path
    """Folder to make for the bag; must not exist."""
    topics: tuple[str, ...] = ()
    """Topics to record, with their full names; none: all that are not hidden."""
    custom_data: Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...")] = ()
    """What the bag should say about itself."""
    bag: BagConfig = field(default_factory=BagConfig)


class Recorder(Node):
    """Subscribes to topics as they appear, and writes their bytes as they come."""

    def __init__(
        self, writer: BagWriter, chosen: tuple[str, ...], flush_period: float, **options: Any
    ) -> None:
        """Record the chosen topics, or all, with a writer that the caller closes.

        Args:
            writer: of the bag.
            chosen: full names of topics; none: all that are not hidden.
            flush_period: how often to hand over to the operating system what came [s].
            **options: of the node.
        """
        super().__init__("recorder", **options)
        self._writer = writer
        self._chosen = frozenset(chosen)
        self._definitions = Definitions()
        self._recorded: dict[str, tuple[RequestedQos, Subscription]] = {}
        self._topics: dict[str, Topic] = {}
        self._unusable: set[str] = set()
        self.last_message = time.monotonic()
        self.create_timer(DISCOVERY_PERIOD, self.discover)
        self.create_timer(flush_period, writer.flush)

    def discover(self) -> None:
        """Take on topics that are new, and adapt to publishers that are."""
        for name, types in self.get_topic_names_and_types():
            if name in self._unusable or not is_wanted(name, self._chosen):
                continue
            publishers = self.get_publishers_info_by_topic(name)
            if publishers:
                self._take_on(name, types, publishers)

    def _take_on(self, name: str, types: list[str], publishers: list[TopicEndpointInfo]) -> None:
        offers = tuple(offered_qos(info) for info in publishers)
        known = self._topics.get(name)
        if known is not None and known.offered_qos == offers:
            return
        try:
            topic = known or self._describe(name, types, publishers[0])
            message_type = message_class(topic.type)
        except InvalidInputError as error:
            self._unusable.add(name)
            self.get_logger().warning(f"{name} is not recorded: {error}")
            return
        # Profiles of publishers that are gone stay on record: their messages do, too.
        merged = tuple(dict.fromkeys((*(known.offered_qos if known else ()), *offers)))
        self._topics[name] = Topic(
            topic.name, topic.type, topic.definition, topic.type_hash, offers
        )
        self._writer.add_topic(
            Topic(topic.name, topic.type, topic.definition, topic.type_hash, merged)
        )
        self._subscribe(name, message_type, adapt(offers))

    def _describe(self, name: str, types: list[str], publisher: TopicEndpointInfo) -> Topic:
        if len(types) > 1:
            raise InvalidInputError(f"it has several types: {', '.join(types)}")
        type_hash = str(publisher.topic_type_hash)
        return Topic(name, types[0], self._definitions.joined(types[0]), type_hash)

    def _subscribe(self, name: str, message_type: type, wanted: RequestedQos) -> None:
        current = self._recorded.get(name)
        if current is not None:
            if current[0] == wanted:
                return
            self.destroy_subscription(current[1])

        def receive(data: bytes, info: dict[str, Any]) -> None:
            self.last_message = time.monotonic()
            self._writer.write(
                name,
                data,
                received=info["received_timestamp"] or time.time_ns(),
                published=info["source_timestamp"],
                sequence=info["publication_sequence_number"] or 0,
            )

        subscription = self.create_subscription(
            message_type,
            name,
            receive,  # type: ignore[arg-type]  # rclpy's hint knows only one argument
            request_profile(wanted),
            raw=True,
        )
        self._recorded[name] = (wanted, subscription)


def parse_custom_data(pairs: tuple[str, ...]) -> dict[str, str]:
    """Return ``KEY=VALUE`` words as a dictionary.

    Raises:
        ConfigError: a word without a key or without ``=``.
    """
    data = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not key or not equals:
            raise ConfigError(f"custom data is {pair!r}; it must be KEY=VALUE")
        data[key] = value
    return data


def record(options: RecordOptions, console: Console) -> None:
    """Record until a signal comes.

    Raises:
        OutputError: the bag cannot be made, or the disk ran full; what was recorded is whole.
    """
    started = time.monotonic()
    custom_data = parse_custom_data(options.custom_data)
    with BagWriter(options.out, options.bag, custom_data) as writer:
        _spin(Recorder(writer, options.topics, options.bag.flush_period), _StopSignal())
        counts = writer.counts
    size = sum(path.stat().st_size for path in options.out.iterdir())
    console.print(
        f"Recorded {sum(counts.values()):,} messages on {len(counts)} topics"
        f" in {time.monotonic() - started:.1f} s: {options.out} ({size / 1e6:.2f} MB)",
        highlight=False,
    )


class _StopSignal:
    """Remembers that SIGINT or SIGTERM came, so that the bag is closed in the main flow."""

    def __init__(self) -> None:
        self.came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.came = True


def _spin(recorder: Recorder, stop: _StopSignal) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(recorder)
    try:
        while not stop.came:
            executor.spin_once(timeout_sec=DISCOVERY_PERIOD)
        _drain(recorder, executor)
    finally:
        executor.shutdown()
        recorder.destroy_node()


def _drain(recorder: Recorder, executor: SingleThreadedExecutor) -> None:
    """Take what has come before the stop."""
    now = recorder.last_message = time.monotonic()
    enough, looks = now + DRAIN_TIME, 0
    while looks < QUIET_LOOKS or now < recorder.last_message + QUIET_TIME:
        before = recorder.last_message
        executor.spin_once(timeout_sec=0.01)
        looks = looks + 1 if recorder.last_message == before else 0
        now = time.monotonic()
        if now > enough + (0.0 if looks else DRAIN_TIME):  # there is always more of some topics
            return


def main() -> None:
    """Run from the command line."""
    arguments = remove_ros_args(sys.argv)[1:]
    options = tyro.cli(RecordOptions, prog="ros2 run sain_bags record", args=arguments)
    console = Console(soft_wrap=True)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    try:
        record(options, console)
    except SainError as error:
        Console(stderr=True, soft_wrap=True).print(
            f"record: {error}", style="red", highlight=False, markup=False
        )
        sys.exit(1)
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
