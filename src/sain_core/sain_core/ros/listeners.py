"""Who hears a node: one that goes on after a crash waits for them, or they would miss the start."""

from collections.abc import Iterable
from time import monotonic
from typing import Final

from rclpy.node import Node

PATIENCE: Final = 10.0  # [s], for listeners that may be gone for good
ANYONE: Final = "anyone"
UNKNOWN: Final = "_NODE_NAME_UNKNOWN_"


def listeners(node: Node, topic: str) -> set[str]:
    """Return the full names of the nodes that subscribe to a topic; it costs some ms."""
    found = node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic))
    return {
        f"{one.node_namespace.rstrip('/')}/{one.node_name}"
        for one in found
        if one.node_name != UNKNOWN
    }


class Return:
    """Waits until those who heard a topic before hear it again."""

    def __init__(self, node: Node, topic: str, names: Iterable[str], anyone: bool = False) -> None:
        """Wait for these nodes; if none was noted in time, for `anyone` at all."""
        self._node, self._topic = node, topic
        self._missing = set(names)
        if anyone and not self._missing:
            self._missing = {ANYONE}
        self._enough = monotonic() + PATIENCE

    def complete(self) -> bool:
        """Tell whether all are back, or have had their time."""
        if self._missing:
            found = listeners(self._node, self._topic)
            self._missing -= found | ({ANYONE} if found else set())
            if self._missing and monotonic() > self._enough:
                names = ", ".join(sorted(self._missing))
                self._node.get_logger().warning(f"goes on without {names}, who listened before")
                self._missing.clear()
        return not self._missing
