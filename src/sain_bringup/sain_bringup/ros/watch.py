"""``ros2 run sain_bringup watch``: the messages of a topic, or the list of topics."""

import sys
import time
from array import array
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Final

import tyro
from rich.console import Console

from sain_bringup.waiting import WaitOptions
from sain_core.config import option
from sain_core.errors import ConfigError
from sain_core.guarding.plugins import nearest

if TYPE_CHECKING:
    from rclpy.node import Node

PROGRAM: Final = "ros2 run sain_bringup watch"
QUIET: Final = 1.0  # [s] without a new topic: all are seen
ALIKE: Final = 0.8  # of the letters: a slip, and no other topic of the graph
SHOWN: Final = 12  # numbers of an array


@dataclass(frozen=True)
class WatchOptions(WaitOptions):
    """Print the messages of a topic, or list the topics when none is given."""

    topic: Annotated[str, tyro.conf.Positional] = option(
        "", "for example scene, push_result or /clock"
    )
    count: int = option(0, "end after so many messages; 0: at Ctrl-C", minimum=0)


class Watcher:
    """Observes the graph and publishes nothing."""

    def __init__(self, node: "Node") -> None:
        self.node = node
        self.received = 0

    def spin(self) -> None:
        """Take what comes within a moment."""
        import rclpy

        from sain_core.ros.node_main import SPIN

        rclpy.spin_once(self.node, timeout_sec=SPIN)

    def topics(self) -> dict[str, str]:
        """Return the type of each topic that is seen by now."""
        return {name: kinds[0] for name, kinds in self.node.get_topic_names_and_types()}

    def all_topics(self, timeout_s: float) -> dict[str, str]:
        """Return the type of each topic of the graph.

        Nodes find each other in their own time, on a busy machine in seconds. So this waits for
        the first other node, and then until no new topic has appeared for a while.

        Raises:
            ConfigError: there is no other node.
        """
        deadline = time.monotonic() + timeout_s
        seen, since = self.topics(), time.monotonic()
        while (alone := len(self.node.get_node_names()) < 2) or time.monotonic() - since < QUIET:
            if alone and time.monotonic() > deadline:
                raise ConfigError(f"no other node in {timeout_s:g} s; is anything running?")
            self.spin()
            if (topics := self.topics()).keys() != seen.keys() or alone:
                seen, since = topics, time.monotonic()
        return seen

    def watch(self, topic: str, timeout_s: float) -> None:
        """Print the messages of a topic from now on.

        The topic may appear later, unless there is one of nearly its name.

        Raises:
            ConfigError: nobody publishes it.
            InvalidInputError: the package of its type is not installed here.
        """
        name = self.node.resolve_topic_name(topic)
        deadline = time.monotonic() + timeout_s
        seen, since = self.topics(), time.monotonic()
        while not (publishers := self.node.get_publishers_info_by_topic(name)):
            misspelt = time.monotonic() - since > QUIET and is_misspelt(name, seen)
            if misspelt or time.monotonic() > deadline:
                raise ConfigError(self._unknown(name))
            self.spin()
            if (topics := self.topics()).keys() != seen.keys():
                seen, since = topics, time.monotonic()
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        from sain_bags.ros.endpoints import message_class

        best = ReliabilityPolicy.BEST_AVAILABLE, DurabilityPolicy.BEST_AVAILABLE
        qos = QoSProfile(depth=100, reliability=best[0], durability=best[1])
        kind = message_class(publishers[0].topic_type)
        self.node.create_subscription(kind, name, self._on_message, qos)

    def _unknown(self, name: str) -> str:
        topics = sorted(topic for topic in self.topics() if topic != name)
        near = nearest(name, topics) or [
            topic for topic in topics if topic.endswith(f"/{name.rsplit('/', 1)[-1]}")
        ]
        hint = f"did you mean {near[0]}?" if near else f"run {PROGRAM!r} for a list"
        return f"nobody publishes {name}; {hint}"

    def _on_message(self, message: Any) -> None:
        self.received += 1
        sys.stdout.write("\n".join(lines(message)) + "\n---\n")
        sys.stdout.flush()


def is_misspelt(name: str, topics: Collection[str]) -> bool:
    """Tell whether a topic in the same namespace has nearly this name, and none has this one."""
    if name in topics:
        return False  # somebody listens to it already, and its publisher is still to be discovered
    namespace, _, own = name.rpartition("/")
    others = [t.rpartition("/")[2] for t in topics if t.rpartition("/")[0] == namespace]
    return bool(nearest(own, others, ALIKE))


def lines(message: Any, indent: str = "") -> Iterator[str]:
    """Yield a message in YAML's manner, long arrays shortened."""
    for field in message.get_fields_and_field_types():
        value = getattr(message, field)
        if hasattr(value, "get_fields_and_field_types"):
            yield f"{indent}{field}:"
            yield from lines(value, indent + "  ")
        elif isinstance(value, list) and value and hasattr(value[0], "SLOT_TYPES"):
            yield f"{indent}{field}:"
            for element in value:
                first, *rest = lines(element, "")
                yield f"{indent}- {first}"
                yield from (f"{indent}  {line}" for line in rest)
        else:
            yield f"{indent}{field}: {_plain(value)}"


def _plain(value: Any) -> str:
    if isinstance(value, str):
        return repr(value)
    if isinstance(value, list | tuple | array) or hasattr(value, "tolist"):
        shown = ", ".join(str(number) for number in value[:SHOWN])
        more = f", ... {len(value)} in all" if len(value) > SHOWN else ""
        return f"[{shown}{more}]"
    return str(value)


def run(options: WatchOptions, console: Console) -> None:
    """List the topics, or watch one until its messages have come or Ctrl-C."""
    from sain_core.ros.node_main import command_node

    with command_node("watch") as node:
        watcher = Watcher(node)
        try:
            if not options.topic:
                for name, kind in sorted(watcher.all_topics(options.timeout).items()):
                    sys.stdout.write(f"{name}  [{kind}]\n")
                return
            watcher.watch(options.topic, options.timeout)
            while not options.count or watcher.received < options.count:
                watcher.spin()
        except KeyboardInterrupt:
            pass  # the usual end
