"""Timers of a clock that never stands still: simulated time does while nothing is simulated."""

from collections.abc import Callable
from typing import Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter

SIMULATED: Final = Parameter("use_sim_time", value=True)
"""``parameter_overrides=[SIMULATED]`` makes a node whose stamps are simulated time."""


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> None:
    """Call back once in each period [s] of wall time, whatever ``use_sim_time`` is."""
    node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
