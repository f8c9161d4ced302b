"""What the nodes that see bodies share: a camera's images in, detections and an overlay out."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import Image
from vision_msgs.msg import Detection3DArray

from sain_core.guarding.ros.reception import Reception, shortened
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, OK, WARN, Diagnostics
from sain_core.ros.parameters import LiveParameters, read_parameters
from sain_core.ros.qos import RELIABLE
from sain_core.shapes.body_file import BodyFile
from sain_vision.detection.overlay import draw_overlay
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import CameraModel
from sain_vision.ros.body_parameter import followed
from sain_vision.ros.camera_input import CameraInput, publish_place
from sain_vision.ros.detections import encode_sightings
from sain_vision.ros.settings import CameraInputConfig


class SightingNode(Node):
    """Publishes the bodies that images show."""

    config: CameraInputConfig
    bodies: BodyFile

    def __init__(
        self,
        name: str,
        settings: type[CameraInputConfig],
        what: str,
        topics: tuple[str, str],
        overlay: str,
        **options: Any,
    ) -> None:
        """Read the bodies and wait for images.

        Args:
            name: of the node.
            settings: its parameters.
            what: it finds, in diagnostics.
            topics: of images and their calibration.
            overlay: topic of images with what was found.
            options: of `Node`.
        """
        super().__init__(name, namespace=NAMESPACE, **options)
        config = read_parameters(self, settings)
        self.use(config)
        cv2.setNumThreads(1)  # more threads wait for each other on images of this size
        self._what = what
        self.reception = reception = Reception(self)
        self.diagnostics = Diagnostics(self, what, more=lambda: reception.figures)
        self._detections = self.create_publisher(Detection3DArray, "detections", RELIABLE)
        self._overlay = self.create_publisher(Image, overlay, RELIABLE)
        publish_place(self, config)
        camera = CameraInput(self, reception, topics, config, self.on_image, self._ignore)
        self.diagnostics.set(WARN, camera.missing)
        LiveParameters(self, config, followed(self, self.use))

    @abstractmethod
    def use(self, config: Any) -> None:
        """Look for the bodies that a file states: take it as `config`, and them as `bodies`."""

    @abstractmethod
    def on_image(self, message: Image, camera: CameraModel) -> None:
        """Find bodies in an image, and `publish` them."""

    def publish(
        self,
        message: Image,
        camera: CameraModel,
        found: tuple[Sequence[Sighting], Sequence[str]],
        grey: Callable[[], np.ndarray],
        begun: float,
    ) -> None:
        """Publish what was found in an image, and what was wrong with it.

        Args:
            message: the image.
            camera: that took it.
            found: bodies, and problems in words.
            grey: makes what the overlay is drawn on.
            begun: when work on the image began [s], of `perf_counter`.
        """
        (sightings, problems), stamp = found, message.header.stamp
        detections = encode_sightings(sightings, self.bodies, self.config.frame, stamp)
        self._detections.publish(detections)
        if self._overlay.get_subscription_count():
            picture = draw_overlay(grey(), sightings, self.bodies, camera)
            self._overlay.publish(codec.encode_image(picture, "bgr8", message.header))
        took = f"{1e3 * (perf_counter() - begun):.0f} ms"
        level, text = (WARN, "; ".join(problems)) if problems else (OK, f"finds {self._what}")
        self.diagnostics.set(level, text, bodies_seen=len(sightings), time=took)

    def _ignore(self, message: Any, error: BaseException) -> None:
        self.diagnostics.set(WARN, shortened(str(error)))
