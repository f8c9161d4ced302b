"""How each kind of topic is delivered, who hears it, and timers that never stand still."""

import time
from collections.abc import Callable, Iterable
from typing import Any, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time_source import TimeSource

from sain_core.guarding.ros.ownership import full_name, is_named

RELIABLE = QoSProfile(depth=10)
"""Scenes, pushes, results, plans and all else that has no need of its own."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Goals: who joins late gets the last one."""

LATCHED_QUEUE = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For who must hear each of some latched messages in turn, and not the last alone."""

TRANSFORMS = QoSProfile(depth=100)
"""``/tf``, as tf2_ros sends it."""

QUEUE = QoSProfile(depth=4000)
"""Pushes and their results: each is answered, also in a burst of 3,000. At ROS's own depth of 10
the middleware drops what more comes, in silence."""

SIMULATED: Final = Parameter("use_sim_time", value=True)
"""``parameter_overrides=[SIMULATED]`` makes a node whose stamps are simulated time."""


SECOND: Final = 1_000_000_000  # [ns]


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> None:
    """Call back once in each period [s] of wall time, whatever ``use_sim_time`` is."""
    node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


_take_time = TimeSource.clock_callback


def _take_possible_time(self: TimeSource, message: Any) -> None:
    """Take a message on ``/clock`` as rclpy does, which raises where its time cannot be."""
    sec, nanosec = message.clock.sec, message.clock.nanosec
    if sec >= 0 and nanosec < SECOND:
        _take_time(self, message)
        return
    get_logger("clock").warning(
        f"a message on /clock is ignored: its time is {sec} s and {nanosec} ns; allowed: from 0 s,"
        f" and 0 to {SECOND - 1} ns",
        throttle_duration_sec=5.0,
    )


TimeSource.clock_callback = _take_possible_time  # type: ignore[assignment, method-assign]
"""Any process may publish the clock: such a message would end every node of simulated time."""


PATIENCE: Final = 10.0  # [s], for listeners that may be gone for good
LATE: Final = 0.5  # [s] between looks for who is new, and from then on until he is told
ANYONE: Final = "anyone"


def listeners(node: Node, topic: str) -> set[str]:
    """Return the full names of the nodes that subscribe to a topic; it costs some ms."""
    endpoints = node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic))
    return {full_name(one) for one in endpoints if is_named(one)}


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
            others = listeners(self._node, self._topic)
            self._missing -= others | ({ANYONE} if others else set())
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
        self._reached: set[bytes] = set()
        self._new: set[bytes] = set()
        steady_timer(node, LATE, self._look)

    def publish(self, message: Any) -> None:
        """Publish a message, which whoever joins later hears, too."""
        self._last = message
        self._reached = self._volatile()
        self._publisher.publish(message)

    def _look(self) -> None:
        """Look for new subscribers; who was new the last time has found this publisher by now."""
        if self._new:
            self._reached |= self._new
            self._new = set()
            self._publisher.publish(self._last)
        count = self._publisher.get_subscription_count()
        if count != self._count and self._last is not None:
            self._count = count
            self._new = self._volatile() - self._reached

    def _volatile(self) -> set[bytes]:
        """Return who hears only what is published from now on; to find that costs some ms."""
        endpoints = self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        volatile = DurabilityPolicy.VOLATILE
        return {
            bytes(one.endpoint_gid) for one in endpoints if one.qos_profile.durability == volatile
        }
