"""How each kind of topic is delivered."""

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

RELIABLE = QoSProfile(depth=10)
"""Scenes, pushes, results, plans and all else that has no need of its own."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Goals: who joins late gets the last one."""

LATCHED_QUEUE = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For who must hear each of some latched messages in turn, and not the last alone."""

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Images and calibrations, from reliable publishers, too: who is late takes the latest alone."""


def newest_of(publishers: Sequence[TopicEndpointInfo]) -> QoSProfile:
    """Return how the newest image is had of all publishers: reliably, where all offer that.

    An image goes in many packets. In best effort it is lost with any of them.
    """
    reliable = ReliabilityPolicy.RELIABLE
    offered = all(one.qos_profile.reliability == reliable for one in publishers)
    return QoSProfile(depth=1, reliability=reliable) if offered else NEWEST


TRANSFORMS = QoSProfile(depth=100)
"""``/tf``, as tf2_ros sends it."""

QUEUE = QoSProfile(depth=4000)
"""Pushes and their results: each is answered, also in a burst of 3,000. At ROS's own depth of 10
the middleware drops what more comes, in silence."""
