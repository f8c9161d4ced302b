"""Subscriptions to all that the page shows of a running graph.

Of some topics only the latest message matters. These are taken at a pace, and not as they come: a
simulator without a pace sends hundreds of scenes a second, and the executor would wake up for each.
"""

from typing import Final

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import Image

from sain_bringup.ros.listener import LatestMessage
from sain_core.guarding.ros.reception import LARGE_BYTES, MOST_BYTES, Reception
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE
from sain_live.ros.updates import StateUpdater
from sain_live.state import LiveState

PICTURE: Final = "camera/overlay"
LATEST: Final = QoSProfile(depth=1)
PERIOD: Final = 1.0 / 40.0  # [s] between looks for new scenes and joints
POLLED: Final = ("scene", "joint_states", "/joint_states")
DESCRIPTIONS: Final = ("robot_description", "/robot_description")
DESCRIPTION_BYTES: Final = 4_000_000  # of a URDF: more than other texts may have
QOS: Final[dict[str, tuple[QoSProfile, ...]]] = {
    "goal": (LATCHED_QUEUE, RELIABLE),  # as the planner: the same one twice is no harm
    "push_result": (QUEUE,),
    "/tf_static": (LATCHED_QUEUE,),
    **dict.fromkeys(("shapes", "learning", "world_parameters", "ghost", *DESCRIPTIONS), (LATCHED,)),
}


class GraphSubscriptions:
    """Hands the messages of a graph to `StateUpdater`."""

    def __init__(self, node: Node, state: LiveState) -> None:
        self._node, self._reception = node, Reception(node)
        self._picture: Subscription | None = None
        self._updater = StateUpdater(state, lambda: bool(node.count_publishers("shapes")))
        self._latest = []
        for topic, (kind, take) in self._updater.handlers.items():
            if topic in POLLED:
                guarded = self._reception.guarded(topic, take, most=LARGE_BYTES)
                self._latest.append((LatestMessage(node, kind, topic), guarded))
                continue
            most = DESCRIPTION_BYTES if topic in DESCRIPTIONS else MOST_BYTES
            for qos in QOS.get(topic, (RELIABLE,)):
                self._reception.listen(kind, topic, take, qos, most=most)
        steady_timer(node, PERIOD, self._poll)

    def _poll(self) -> None:
        for latest, take in self._latest:
            if (message := latest.take()) is not None:
                take(message)

    def watch_camera(self, viewed: bool) -> None:
        """Take pictures while the page is viewed: else no node has to draw them."""
        if viewed and self._picture is None:
            take = self._updater.on_picture
            self._picture = self._reception.listen(Image, PICTURE, take, LATEST, most=LARGE_BYTES)
        elif not viewed and self._picture is not None:
            self._node.destroy_subscription(self._picture)
            self._picture = None
