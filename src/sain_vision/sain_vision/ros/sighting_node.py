"""What the nodes that see bodies share: a camera's images in, detections and an overlay out."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, ClassVar

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
from sain_vision.detection.sighting import Sighting, draw_overlay
from sain_vision.optics import CameraModel
from sain_vision.ros.body_parameter import followed
from sain_vision.ros.camera_input import CameraInput, publish_place
from sain_vision.ros.detections import encode_sightings
from sain_vision.ros.settings import CameraInputConfig

Found = tuple[Sequence[Sighting], Sequence[str], Callable[[], np.ndarray]]
"""Bodies in an image, problems in words, and what makes the grey image of the overlay."""


class SightingNode(Node):
    """Publishes the bodies that images show."""

    settings: ClassVar[type[CameraInputConfig]]  # its parameters
    what: ClassVar[str]  # it finds, in diagnostics
    topics: ClassVar[tuple[str, str]]  # of images and their calibration
    overlay: ClassVar[str]  # topic of images with what was found
    config: CameraInputConfig
    bodies: BodyFile

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, namespace=NAMESPACE, **options)
        config = read_parameters(self, self.settings)
        self.use(config)
        cv2.setNumThreads(1)  # more threads wait for each other on images of this size
        self.reception = reception = Reception(self)
        self.diagnostics = Diagnostics(self, self.what, more=lambda: reception.figures)
        self._detections = self.create_publisher(Detection3DArray, "detections", RELIABLE)
        self._overlay = self.create_publisher(Image, self.overlay, RELIABLE)
        publish_place(self, config)
        camera = CameraInput(self, reception, self.topics, config, self._on_image, self._ignore)
        self.diagnostics.set(WARN, camera.missing)
        LiveParameters(self, config, followed(self, self.use))

    @abstractmethod
    def use(self, config: Any) -> None:
        """Look for the bodies that a file states: take it as `config`, and them as `bodies`."""

    @abstractmethod
    def find(self, message: Image, camera: CameraModel) -> Found:
        """Find bodies in an image."""

    def _on_image(self, message: Image, camera: CameraModel) -> None:
        """Publish what an image shows, and what is wrong with it."""
        begun, stamp = perf_counter(), message.header.stamp
        sightings, problems, grey = self.find(message, camera)
        detections = encode_sightings(sightings, self.bodies, self.config.frame, stamp)
        self._detections.publish(detections)
        if self._overlay.get_subscription_count():
            picture = draw_overlay(grey(), sightings, self.bodies, camera)
            self._overlay.publish(codec.encode_image(picture, "bgr8", message.header))
        took = f"{1e3 * (perf_counter() - begun):.0f} ms"
        level, text = (WARN, "; ".join(problems)) if problems else (OK, f"finds {self.what}")
        self.diagnostics.set(level, text, bodies_seen=len(sightings), time=took)

    def _ignore(self, message: Any, error: BaseException) -> None:
        self.diagnostics.set(WARN, shortened(str(error)))
