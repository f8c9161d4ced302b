"""The node that finds tags: images in, poses of bodies with covariance out."""

from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
from rclpy.node import Node
from sensor_msgs.msg import Image
from vision_msgs.msg import Detection3DArray

from sain_core.errors import ConfigError
from sain_core.guarding.ros.reception import Reception, shortened
from sain_core.ros.node_main import NAMESPACE, OK, WARN, Diagnostics
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import RELIABLE
from sain_core.shapes.body_file import read_bodies
from sain_vision.detection.overlay import draw_overlay
from sain_vision.detection.tags import TagFinder, TagLocator
from sain_vision.optics import CameraModel
from sain_vision.ros.camera_input import CameraInput
from sain_vision.ros.detections import encode_sightings
from sain_vision.ros.images import decode_grey, encode_image
from sain_vision.ros.settings import TagNodeConfig

TOPICS = ("camera/color/image_raw", "camera/color/camera_info")


class TagNode(Node):
    """Publishes the bodies whose tags an image shows."""

    def __init__(self, **options: Any) -> None:
        """Read the bodies and wait for images."""
        super().__init__("tag_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, TagNodeConfig)
        if not config.bodies:
            raise ConfigError("parameter 'bodies' is empty; give the YAML file of the bodies")
        self.bodies = read_bodies(Path(config.bodies).expanduser())
        if not any(self.bodies.tags):
            raise ConfigError(f"no body in {config.bodies} has tags; give 'tags' to one of them")
        cv2.setNumThreads(1)  # more threads wait for each other on images of this size
        self.finder = TagFinder(config.tags)
        self.locator = TagLocator(self.bodies, config.tags)
        self.reception = reception = Reception(self)
        self.diagnostics = Diagnostics(self, "tags", more=lambda: reception.figures)
        self.detections = self.create_publisher(Detection3DArray, "detections", RELIABLE)
        self.overlay = self.create_publisher(Image, "camera/overlay", RELIABLE)
        self.input = CameraInput(self, reception, TOPICS, config, self._on_image, self._ignore)
        self.diagnostics.set(WARN, self.input.missing)
        count = sum(map(len, self.bodies.tags))
        self.ready = f"{count} tags of {config.tags.family} on {len(self.bodies.names)} bodies"

    def _on_image(self, message: Image, camera: CameraModel) -> None:
        begun = perf_counter()
        grey = decode_grey(message)
        sightings, problems = self.locator.locate(self.finder.find(grey), camera)
        header = message.header
        self.detections.publish(
            encode_sightings(sightings, self.bodies, self.config.frame, header.stamp)
        )
        if self.overlay.get_subscription_count():
            picture = draw_overlay(grey, sightings, self.bodies, camera)
            self.overlay.publish(encode_image(picture, "bgr8", header))
        took = f"{1e3 * (perf_counter() - begun):.0f} ms"
        figures = {"bodies_seen": len(sightings), "time": took}
        if problems:
            self.diagnostics.set(WARN, "; ".join(problems), **figures)
        else:
            self.diagnostics.set(OK, "finds tags", **figures)

    def _ignore(self, message: Any, error: BaseException) -> None:
        self.diagnostics.set(WARN, shortened(str(error)))
