"""Who else is there: other publishers of a topic, of which two would contradict each other, and
who hears a node: one that goes on after a crash waits for them, or they would miss the start.
"""

import time
from collections.abc import Iterable
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_core.errors import BusyError
from sain_core.ros.qos import LATCHED
from sain_core.ros.steady import steady_timer

POLL_S: Final = 0.05
PATIENCE: Final = 10.0  # [s], for listeners that may be gone for good
LATE: Final = 0.5  # [s] between looks for who is new, and from then on until he is told
ANYONE: Final = "anyone"
NAME_WAIT_S: Final = 2.0  # for the name of a node whose publisher was discovered before


def refuse_peers(node: Node, topics: Iterable[str], wait_s: float) -> None:
    """Look for other publishers of a node's own topics, before it publishes them itself.

    For so long, as peers take their time to be discovered.

    Raises:
        BusyError: naming topic and peer.
    """
    end = time.monotonic() + wait_s
    while True:
        for topic in topics:
            for peer in publishers(node, topic, NAME_WAIT_S):
                name = node.resolve_topic_name(topic)
                raise BusyError(f"{peer} publishes {name} already; {advice(name)}")
        if time.monotonic() >= end:
            return
        time.sleep(POLL_S)


def refuse_rivals(node: Node, topics: Iterable[str]) -> None:
    """Look whether a topic that one node should own has two publishers.

    Discovery takes its time on a busy machine: who found no peer at first may do so later.

    Raises:
        BusyError: naming topic and publishers.
    """
    for topic in topics:
        if len(owners := publishers(node, topic, NAME_WAIT_S)) > 1:
            name = node.resolve_topic_name(topic)
            raise BusyError(
                f"{' and '.join(owners)} publish {name}, so another graph is running already;"
                " stop it, or start this one with another ROS_DOMAIN_ID"
            )


def advice(name: str) -> str:
    """Return what helps where a topic has two owners."""
    if name == "/clock":
        return "stop it, or give each graph a namespace and its own clock with -r /clock:=clock"
    return "stop it, or start this one with another ROS_DOMAIN_ID"


def is_named(publisher: TopicEndpointInfo) -> bool:
    """Tell whether the node of a publisher is discovered, too."""
    return not (publisher.node_name + publisher.node_namespace).count("_UNKNOWN_")


def publishers(node: Node, topic: str, wait_s: float) -> list[str]:
    """Return the full names of the nodes that publish a topic; wait so long for unknown ones."""
    end = time.monotonic() + wait_s
    while True:
        found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if all(map(is_named, found)) or time.monotonic() >= end:
            return [full_name(one) for one in found]
        time.sleep(POLL_S)


def full_name(publisher: TopicEndpointInfo) -> str:
    """Return namespace and name of a publisher's node."""
    if not is_named(publisher):
        return "a node whose name is not known"
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"


def listeners(node: Node, topic: str) -> set[str]:
    """Return the full names of the nodes that subscribe to a topic; it costs some ms."""
    found = node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic))
    return {full_name(one) for one in found if is_named(one)}


class Return:
    """Waits until those who heard a topic before hear it again."""

    def __init__(self, node: Node, topic: str, names: Iterable[str], anyone: bool = False) -> None:
        """Wait for these nodes; if none was noted in time, for `anyone` at all."""
        self._node, self._topic = node, topic
        self._missing = set(names)
        if anyone and not self._missing:
            self._missing = {ANYONE}
        self._enough = time.monotonic() + PATIENCE

    def complete(self) -> bool:
        """Tell whether all are back, or have had their time."""
        if self._missing:
            found = listeners(self._node, self._topic)
            self._missing -= found | ({ANYONE} if found else set())
            if self._missing and time.monotonic() > self._enough:
                names = ", ".join(sorted(self._missing))
                self._node.get_logger().warning(f"goes on without {names}, who listened before")
                self._missing.clear()
        return not self._missing


class LatchedTopic:
    """A latched topic that also those hear who did not ask for what was latched.

    A subscriber with ROS's default durability (volatile) that joins late hears nothing; so does
    ``ros2 topic echo --qos-reliability best_effort``. For such a one the last message is published
    again, once, with the same stamp. Make and call this on the executor's thread.
    """

    def __init__(self, node: Node, kind: type, topic: str) -> None:
        """Create the publisher."""
        self._node = node
        self._publisher = node.create_publisher(kind, topic, LATCHED)
        self._last: Any = None
        self._count = 0
        self._told: set[bytes] = set()
        self._new: set[bytes] = set()
        steady_timer(node, LATE, self._look)

    def publish(self, message: Any) -> None:
        """Publish a message, which whoever joins later hears, too."""
        self._last = message
        self._told = self._volatile()
        self._publisher.publish(message)

    def _look(self) -> None:
        """Look for new subscribers; who was new the last time has found this publisher by now."""
        if self._new:
            self._told |= self._new
            self._new = set()
            self._publisher.publish(self._last)
        count = self._publisher.get_subscription_count()
        if count != self._count and self._last is not None:
            self._count = count
            self._new = self._volatile() - self._told

    def _volatile(self) -> set[bytes]:
        """Return who hears only what is published from now on; to find that costs some ms."""
        found = self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        volatile = DurabilityPolicy.VOLATILE
        return {bytes(one.endpoint_gid) for one in found if one.qos_profile.durability == volatile}
