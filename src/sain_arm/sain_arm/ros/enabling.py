"""Who lets the arm move: a heartbeat on ``enable``, and what ends it.

The signal is `std_msgs/Bool`, true. A pendant's or a safety relay's node may publish it in place of
``ros2 run sain_arm enable``.
"""

import time
from collections.abc import Callable
from typing import Any, Final

from action_msgs.srv import CancelGoal
from rclpy.node import Node
from std_msgs.msg import Bool

from sain_core.ros.node_main import command_node, spin_until
from sain_core.ros.qos import RELIABLE, steady_timer

PERIOD: Final = 0.1  # [s]
LONGEST: Final = 1.0  # [s] that an answer of the controller is waited for


class EnableWatch:
    """Whether somebody lets the arm move: the latest signal is true, and recent."""

    def __init__(self, timeout: float) -> None:
        """Believe a signal for so long [s]."""
        self._timeout = timeout
        self._until = 0.0

    def listen(self, message: Bool) -> None:
        """Take a signal; false disables at once."""
        self._until = time.monotonic() + self._timeout if message.data else 0.0

    @property
    def alive(self) -> bool:
        """Whether the arm may move now."""
        return time.monotonic() < self._until


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
