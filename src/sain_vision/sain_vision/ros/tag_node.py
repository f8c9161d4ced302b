"""The node that finds tags: images in, poses of bodies with covariance out."""

from time import perf_counter
from typing import Any

import cv2
from rclpy.node import Node
from sensor_msgs.msg import Image

from sain_core.errors import ConfigError
from sain_core.guarding.ros.reception import Reception, shortened
from sain_core.ros.node_main import NAMESPACE, WARN
from sain_core.ros.parameters import LiveParameters, read_parameters
from sain_vision.detection.tags import TagFinder, TagLocator
from sain_vision.optics import CameraModel
from sain_vision.ros.body_parameter import followed, read_body_file
from sain_vision.ros.camera_input import CameraInput, CameraPlace
from sain_vision.ros.images import decode_grey
from sain_vision.ros.settings import COLOUR_TOPICS, TagNodeConfig
from sain_vision.ros.sighting_output import SightingOutput


class TagNode(Node):
    """Publishes the bodies whose tags an image shows."""

    def __init__(self, **options: Any) -> None:
        """Read the bodies and wait for images."""
        super().__init__("tag_node", namespace=NAMESPACE, **options)
        config = read_parameters(self, TagNodeConfig)
        self._use(config)
        cv2.setNumThreads(1)  # more threads wait for each other on images of this size
        self.finder = TagFinder(config.tags)
        self.reception = reception = Reception(self)
        self.output = SightingOutput(self, reception, "tags", "camera/overlay")
        self.diagnostics = self.output.diagnostics
        self.place = CameraPlace(self, config.extrinsics, config.frame)
        self.input = CameraInput(
            self, reception, COLOUR_TOPICS, config, self._on_image, self._ignore
        )
        self.diagnostics.set(WARN, self.input.missing)
        LiveParameters(self, config, followed(self, self._use))
        count = sum(map(len, self.bodies.tags))
        self.ready = f"{count} tags of {config.tags.family} on {len(self.bodies.names)} bodies"

    def _use(self, config: TagNodeConfig) -> None:
        """Look for the tags of the bodies that a file states."""
        bodies = read_body_file(config.bodies)
        if not any(bodies.tags):
            raise ConfigError(f"no body in {config.bodies} has tags; give 'tags' to one of them")
        self.config, self.bodies = config, bodies
        self.locator = TagLocator(bodies, config.tags)

    def _on_image(self, message: Image, camera: CameraModel) -> None:
        begun = perf_counter()
        grey = decode_grey(message)
        sightings, problems = self.locator.locate(self.finder.find(grey), camera)
        problems += self.finder.problems
        if self.finder.problems:
            self.get_logger().warning("; ".join(self.finder.problems), once=True)
        self.output.publish(
            message, camera, self.bodies, self.config.frame, (sightings, problems), lambda: grey,
            begun,
        )  # fmt: skip

    def _ignore(self, message: Any, error: BaseException) -> None:
        self.diagnostics.set(WARN, shortened(str(error)))
