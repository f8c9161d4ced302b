"""What the cameras of a graph see, for a policy that observes it."""

from collections.abc import Iterable
from functools import partial
from threading import Condition
from typing import Final

from rclpy.node import Node
from sensor_msgs.msg import Image

from sain_core.errors import ModelUnavailableError
from sain_core.guarding.ros.reception import LARGE_BYTES, Reception
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import NEWEST
from sain_core.wire.images import Colour, camera_key, decode_colour

KIND: Final = "sensor_msgs/msg/Image"
LOOK: Final = 0.5  # [s] between looks for topics
FRESH: Final = 1.0  # [s] to wait for an image


class Cameras:
    """Hears the images of those keys that a policy observes. Only `see` is for other threads."""

    def __init__(self, node: Node, reception: Reception, keys: Iterable[str]) -> None:
        """Look for the topics until each key has one."""
        self._node, self._reception = node, reception
        self._missing = set(keys)
        self._others: set[str] = set()  # keys that there are, too
        self._came = Condition()
        self._latest: dict[str, Image] = {}
        if self._missing:
            steady_timer(node, LOOK, self._look)

    def see(self, key: str) -> Colour:
        """Return the first image that comes from now on, as a data set's come before their pushes.

        Raises `ModelUnavailableError`: none comes, and why; `InvalidInputError`: it has no colours.
        """
        with self._came:
            before = self._latest.get(key)
            if not self._came.wait_for(lambda: self._latest.get(key) is not before, FRESH):
                there = f"; there are {', '.join(sorted(self._others)) or 'none'}"
                why = there if key in self._missing else f" within {FRESH:g} s"
                raise ModelUnavailableError(f"no image of {key} came{why}")
            return decode_colour(self._latest[key])

    def _look(self) -> None:
        for topic, kinds in sorted(self._node.get_topic_names_and_types()):
            if kinds != [KIND]:
                continue
            key = camera_key(topic, self._node.get_namespace())
            if key in self._missing:
                self._missing.remove(key)
                take = partial(self._take, key)
                self._reception.listen(Image, topic, take, NEWEST, most=LARGE_BYTES)
                self._node.get_logger().info(f"the policy observes {topic}, as {key}")
            else:
                self._others.add(key)

    def _take(self, key: str, message: Image) -> None:
        with self._came:
            self._latest[key] = message
            self._came.notify_all()
