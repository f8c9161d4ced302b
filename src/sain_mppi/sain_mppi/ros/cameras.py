"""What the cameras of a graph see, for a policy that observes it."""

from collections.abc import Iterable
from functools import partial
from threading import Condition
from typing import Final

from rclpy.node import Node
from sensor_msgs.msg import Image

from sain_core.errors import InvalidInputError, ModelUnavailableError
from sain_core.guarding.ros.reception import LARGE_BYTES, Reception
from sain_core.ros.codec import decode_time
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import newest_of
from sain_core.wire.images import USUAL, Colour, camera_key, decode_colour

KIND: Final = "sensor_msgs/msg/Image"
LOOK: Final = 0.5  # [s] between looks for topics
FRESH: Final = 1.0  # [s] to wait for an image


class Cameras:
    """Hears the images of those keys that a policy observes. Only `see` is for other threads."""

    def __init__(self, node: Node, reception: Reception, keys: Iterable[str]) -> None:
        """Look for the topics until each key has one."""
        self._node, self._reception = node, reception
        self._topics: dict[str, tuple[str, ...]] = dict.fromkeys(keys, ())  # by key
        self._others: set[str] = set()  # keys that there are, too
        self._heard: set[str] = set()
        self._came = Condition()
        self._latest: dict[str, Image] = {}
        if self._topics:
            steady_timer(node, LOOK, self._look)

    def see(self, key: str, after: float) -> Colour:
        """Return an image that was taken after a time [s]; one without a stamp, after this call.

        Raises `ModelUnavailableError`: none comes, and why; `InvalidInputError`: it has no colours.
        """
        if len(self._topics[key]) > 1:
            raise ModelUnavailableError(self._why(key, after))
        with self._came:
            before = self._latest.get(key)

            def found() -> Image | None:
                image = self._latest.get(key)
                stamp = 0.0 if image is None else decode_time(image.header.stamp)
                return image if stamp >= after or (image is not before and not stamp) else None

            image = self._came.wait_for(found, FRESH)
        if image is None:
            raise ModelUnavailableError(f"no image of {key} came: {self._why(key, after)}")
        try:
            return decode_colour(image)
        except InvalidInputError as error:
            raise InvalidInputError(f"{key}: {error}") from error

    def _why(self, key: str, after: float) -> str:
        topics = self._topics[key]
        if not topics:
            return f"no topic has this name; there are {', '.join(sorted(self._others)) or 'none'}"
        if len(topics) > 1:
            return f"{' and '.join(topics)} have this name; remap one of them"
        if (image := self._latest.get(key)) is None:
            return f"nothing came on {topics[0]}"
        late = after - decode_time(image.header.stamp)
        return f"the last one on {topics[0]} is {late:.3g} s older than the scene at rest"

    def _look(self) -> None:
        namespace, known = self._node.get_namespace(), dict[str, tuple[str, ...]]()
        for topic, kinds in sorted(self._node.get_topic_names_and_types()):
            is_camera = kinds == [KIND] and topic.endswith(f"/{USUAL}")
            if is_camera and self._node.count_publishers(topic):
                key = camera_key(topic, namespace)
                known[key] = (*known.get(key, ()), topic)
        self._others = {*known} - {*self._topics}
        for key in self._topics:
            self._topics[key] = known.get(key, ())
            if len(self._topics[key]) == 1 and self._topics[key][0] not in self._heard:
                self._listen(key, self._topics[key][0])

    def _listen(self, key: str, topic: str) -> None:
        self._heard.add(topic)
        qos = newest_of(self._node.get_publishers_info_by_topic(topic))
        self._reception.listen(Image, topic, partial(self._take, key), qos, most=LARGE_BYTES)
        self._node.get_logger().info(f"the policy observes {topic}, as {key}")

    def _take(self, key: str, image: Image) -> None:
        with self._came:
            self._latest[key] = image
            self._came.notify_all()
