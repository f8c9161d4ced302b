"""``ros2 run sain_arm enable``: lets the arm move for as long as this runs.

The signal is a heartbeat: `std_msgs/Bool`, true, on ``enable``. A pendant's or a safety relay's
node may publish it in place of this command. At its end this command also cancels all goals of the
controller itself: `arm_node`, which does so too, may be dead.
"""

import time
from dataclasses import dataclass
from typing import Any, Final

from action_msgs.srv import CancelGoal
from rclpy.node import Node
from rich.console import Console
from std_msgs.msg import Bool

from sain_arm.robot.robot import read_robot
from sain_core.config import Config, option
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


@dataclass(frozen=True)
class EnableOptions(Config):
    """Let the arm move until Ctrl-C."""

    robot: str = option("", "its file or name: at the end its controller's goals are cancelled")
    seconds: float = option(0.0, "end after this time; 0: on Ctrl-C", unit="s", minimum=0.0)


def run(options: EnableOptions, console: Console) -> int:
    """Publish the heartbeat until the end."""
    controller = read_robot(options.robot).controller if options.robot else ""
    with command_node("enable") as node:
        publisher = node.create_publisher(Bool, "enable", RELIABLE)
        steady_timer(node, PERIOD, lambda: publisher.publish(Bool(data=True)))
        console.print(f"the arm may move: {publisher.topic_name}. Ctrl-C stops it.")
        try:
            _wait(node, options.seconds)
        finally:
            publisher.publish(Bool(data=False))
            if controller:
                spin_until(node, cancel_all(node, controller).done, LONGEST)
    return 0


def cancel_all(node: Node, controller: str) -> Any:
    """Ask a controller to cancel every goal, whoever sent it; return the answer to come."""
    name = f"/{controller.strip('/')}/follow_joint_trajectory/_action/cancel_goal"
    return node.create_client(CancelGoal, name).call_async(CancelGoal.Request())  # no id: all


def _wait(node: Node, seconds: float) -> None:
    """Spin for a time [s]; 0: for ever."""
    spin_until(node, lambda: False, seconds or float("inf"))
