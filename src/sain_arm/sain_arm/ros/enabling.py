"""``ros2 run sain_arm enable``: lets the arm move for as long as this runs.

The signal is a heartbeat: `std_msgs/Bool`, true, on ``enable``. A pendant's or a safety relay's
node may publish it in place of this command.
"""

import time
from dataclasses import dataclass
from typing import Final

from rclpy.node import Node
from rich.console import Console
from std_msgs.msg import Bool

from sain_core.config import Config, option
from sain_core.ros.node_main import command_node, spin_until
from sain_core.ros.qos import RELIABLE, steady_timer

PERIOD: Final = 0.1  # [s]


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

    seconds: float = option(0.0, "end after this time; 0: on Ctrl-C", unit="s", minimum=0.0)


def run(options: EnableOptions, console: Console) -> int:
    """Publish the heartbeat until the end."""
    with command_node("enable") as node:
        publisher = node.create_publisher(Bool, "enable", RELIABLE)
        steady_timer(node, PERIOD, lambda: publisher.publish(Bool(data=True)))
        console.print(f"the arm may move: {publisher.topic_name}. Ctrl-C stops it.")
        try:
            _wait(node, options.seconds)
        finally:
            publisher.publish(Bool(data=False))
    return 0


def _wait(node: Node, seconds: float) -> None:
    """Spin for a time [s]; 0: for ever."""
    spin_until(node, lambda: False, seconds or float("inf"))
