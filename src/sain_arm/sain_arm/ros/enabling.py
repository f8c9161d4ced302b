"""Who lets the arm move: a heartbeat on ``enable``, and what ends it.

The signal is `std_msgs/Bool`, true. A pendant's or a safety relay's node may publish it in place of
``ros2 run sain_arm enable``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import inf
from time import monotonic
from typing import Any, Final

from action_msgs.srv import CancelGoal
from rclpy.node import Node
from std_msgs.msg import Bool

from sain_core.guarding.ros.ownership import publishers
from sain_core.ros.node_main import command_node, spin_until, steady_timer
from sain_core.ros.qos import RELIABLE

PERIOD: Final = 0.1  # [s]
HOLD: Final = 0.3  # [s] for which only true must come
LONGEST_HOLD: Final = 3.0  # [s] that false counts, where several publish
SLOWER: Final = 1.5  # times as long as between two that are false
LONGEST: Final = 1.0  # [s] that an answer of the controller is waited for


class Enabled(Enum):
    """Whether the arm may move, and why not."""

    SILENT = "nobody publishes true"
    DENIED = "false is published"
    WAITING = f"only true must come for {HOLD:g} s"
    YES = "enabled"


@dataclass(frozen=True)
class Signal:
    """A message on ``enable``, when it came [s], and how many publishers there were."""

    enabled: bool
    time: float
    publishers: int = 1


class EnableGate:
    """Lets the arm move while all signals are true: one that is false counts at once, and holds.

    It holds until only true has come for `HOLD`. Who of several publishes false is not visible,
    so with several it holds for longer than the time between two of them.
    """

    def __init__(self, timeout: float) -> None:
        """Believe a signal for so long [s]."""
        self._timeout = timeout
        self._since = self._true = -inf  # the first and the latest of an unbroken row of true
        self._false = self._held = -inf  # the latest false, and until when it counts
        self._any_true, self._several = -inf, False

    def update(self, signal: Signal) -> None:
        """Take a signal."""
        now = signal.time
        if signal.enabled:
            if now > self._true + self._timeout:
                self._since = now
            self._true = self._any_true = now
            return
        self._several = signal.publishers > 1
        gap = min(SLOWER * (now - self._false), LONGEST_HOLD) if self._several else 0.0
        self._held, self._false, self._true = now + max(gap, HOLD), now, -inf

    def state(self, now: float) -> Enabled:
        """Return whether the arm may move at a time [s]."""
        if now < self._held:
            return Enabled.DENIED
        if now > self._true + self._timeout:
            return Enabled.SILENT
        return Enabled.YES if now >= self._since + HOLD else Enabled.WAITING

    def is_disputed(self, now: float) -> bool:
        """Tell whether one of several publishers says true, and another one false."""
        recent = now - LONGEST_HOLD
        return self._several and self._false > recent and self._any_true > recent


class EnableListener(EnableGate):
    """The gate of a node, with those who publish its signal."""

    def __init__(self, node: Node, timeout: float) -> None:
        """Believe a signal for so long [s]."""
        super().__init__(timeout)
        self._node, self._topic = node, node.resolve_topic_name("enable")
        self._disputers = list[str]()  # nodes that disagree

    def listen(self, message: Bool) -> None:
        """Take a signal; publishers that disagree are named in the log."""
        now, count = monotonic(), self._node.count_publishers(self._topic)
        self.update(Signal(message.data, now, count))
        if not message.data and self.is_disputed(now) and len(self._disputers) != count:
            self._disputers = publishers(self._node, self._topic)
            self._node.get_logger().warning(self.disabled)

    @property
    def disabled(self) -> str:
        """Why the arm may not move; empty: it may."""
        now = monotonic()
        state = self.state(now)
        if state is Enabled.YES:
            return ""
        if self._disputers and self.is_disputed(now):
            return (
                f"the arm is not enabled: {' and '.join(self._disputers)} disagree on"
                f" {self._topic}; all must publish true"
            )
        return f"the arm is not enabled: {state.value} on {self._topic}"


def publish_heartbeat(seconds: float, controller: str, say: Callable[[str], None]) -> None:
    """Let the arm move for a time [s], 0: until the process is interrupted.

    At the end all goals of the controller are cancelled; empty: of none. `say` is given the topic.
    """
    with command_node("enable") as node:
        publisher = node.create_publisher(Bool, "enable", RELIABLE)
        steady_timer(node, PERIOD, lambda: publisher.publish(Bool(data=True)))
        say(publisher.topic_name)
        try:
            spin_until(node, lambda: False, seconds or float("inf"))
        finally:
            publisher.publish(Bool(data=False))
            if controller:
                spin_until(node, cancel_all(node, controller).done, LONGEST)


def cancel_all(node: Node, controller: str) -> Any:
    """Ask a controller to cancel every goal, whoever sent it; return the answer to come."""
    name = f"/{controller.strip('/')}/follow_joint_trajectory/_action/cancel_goal"
    return node.create_client(CancelGoal, name).call_async(CancelGoal.Request())  # no id: all
