"""How a node is doing, on ``/diagnostics``: once a second, and at once when that changes.

A status is named ``node: task``, as diagnostic_updater names it, so aggregators can group by node.
"""

from collections.abc import Callable, Mapping
from typing import Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from sain_core.ros.qos import RELIABLE
from sain_core.ros.steady import steady_timer

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
SEPARATOR: Final = ": "  # of node and task


class Diagnostics:
    """Publishes the state of one node. Make and call it from the executor's thread."""

    def __init__(
        self,
        node: Node,
        task: str,
        period_s: float = 1.0,
        now: Callable[[], Time] | None = None,
        more: Callable[[], Mapping[str, object]] = dict,
    ) -> None:
        """Report for this node's task, first as starting.

        `now` replaces its clock for the stamps; `more` are figures as they are when published.
        """
        self._more = more
        self._values: Mapping[str, object] = {}
        self._now = now or (lambda: node.get_clock().now().to_msg())
        name = f"{node.get_fully_qualified_name()}{SEPARATOR}{task}"
        self._status = DiagnosticStatus(level=OK, name=name, message="starting", hardware_id="sain")
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", RELIABLE)
        steady_timer(node, period_s, self.publish)

    def set(self, level: bytes, message: str, **values: object) -> None:
        """Say how the node is doing, with figures of interest."""
        changed = (level, message) != (self._status.level, self._status.message)
        self._status.level = level
        self._status.message = message
        self._values = values
        if changed:
            self.publish()

    def publish(self) -> None:
        """Publish the state as it was last set."""
        values = {**self._values, **self._more()}
        self._status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = self._now()
        self._publisher.publish(message)


def node_of(status: DiagnosticStatus) -> str:
    """Return the full name of the node that a status is of; older recordings name no task."""
    return str(status.name).partition(SEPARATOR)[0]
