"""How each kind of topic is delivered."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

RELIABLE = QoSProfile(depth=10)
"""Scenes, pushes, results, plans and all else that has no need of its own."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Goals: who joins late gets the last one."""

LATCHED_QUEUE = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For who must hear each of some latched messages in turn, and not the last alone."""

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Images: who is late takes the latest alone."""

TRANSFORMS = QoSProfile(depth=100)
"""``/tf``, as tf2_ros sends it."""

QUEUE = QoSProfile(depth=4000)
"""Pushes and their results: each is answered, also in a burst of 3,000. At ROS's own depth of 10
the middleware drops what more comes, in silence."""
