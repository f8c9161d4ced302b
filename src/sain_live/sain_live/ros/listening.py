"""Subscriptions to all that the page shows of a running graph."""

from collections.abc import Callable
from threading import Lock
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import QoSProfile

from sain_core.guarding.ros.reception import Reception
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE
from sain_live.ros.hearing import Hearing
from sain_live.ros.polling import Polling
from sain_live.state import LiveState

RATE: Final = 60.0  # [Hz], looks for new scenes and joints
POLLED: Final = ("scene", "joint_states")
UNLIMITED: Final = "robot_description"  # longer than texts elsewhere may be: it has its own limit
QOS: Final[dict[str, tuple[QoSProfile, ...]]] = {
    "shapes": (LATCHED,),
    "goal": (LATCHED_QUEUE, RELIABLE),  # as the planner: the same one twice is no harm
    "push_result": (QUEUE,),
    "world_parameters": (LATCHED,),
    "robot_description": (LATCHED,),
    "/tf_static": (LATCHED_QUEUE,),
}


class Listening:
    """Hands the messages of a graph to `Hearing`."""

    def __init__(self, node: Node, known: LiveState) -> None:
        """Listen from now on."""
        self._lock = Lock()  # scenes come on a thread of their own
        reception = Reception(node)
        self._polling = Polling(node, reception, RATE)
        hearing = Hearing(known, lambda: bool(node.count_publishers("shapes")))
        for topic, (kind, callback) in hearing.handlers.items():
            take = self._locked(callback)
            if topic in POLLED:
                self._polling.listen(kind, topic, take)
                continue
            for qos in QOS.get(topic, (RELIABLE,)):
                if topic == UNLIMITED:
                    node.create_subscription(kind, topic, take, qos)
                else:
                    reception.listen(kind, topic, take, qos)
        self._polling.start()

    def close(self) -> None:
        """Listen no more."""
        self._polling.close()

    def _locked(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            with self._lock:
                callback(message)

        return take
