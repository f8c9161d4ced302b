"""Timers of a clock that never stands still, as simulated time may, and a guard of that."""

from collections.abc import Callable
from typing import Any, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time_source import TimeSource

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
