"""What a node has seen in an image: detections, an overlay while somebody looks, diagnostics."""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import Image
from vision_msgs.msg import Detection3DArray

from sain_core.guarding.ros.reception import Reception
from sain_core.ros import codec
from sain_core.ros.node_main import OK, WARN, Diagnostics
from sain_core.ros.qos import RELIABLE
from sain_core.shapes.body_file import BodyFile
from sain_vision.detection.overlay import draw_overlay
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import CameraModel
from sain_vision.ros.detections import encode_sightings


class SightingOutput:
    """Publishes what was seen in each image."""

    def __init__(self, node: Node, reception: Reception, what: str, overlay: str) -> None:
        """Say in diagnostics that the node finds this; draw on the topic `overlay`."""
        self._what = what
        self.diagnostics = Diagnostics(node, what, more=lambda: reception.figures)
        self._detections = node.create_publisher(Detection3DArray, "detections", RELIABLE)
        self._overlay = node.create_publisher(Image, overlay, RELIABLE)

    def publish(
        self,
        message: Image,
        camera: CameraModel,
        bodies: BodyFile,
        frame: str,
        found: tuple[Sequence[Sighting], Sequence[str]],
        grey: Callable[[], np.ndarray],
        begun: float,
    ) -> None:
        """Publish what was found in an image, and what was wrong with it.

        Args:
            message: the image.
            camera: that took it.
            bodies: that were looked for.
            frame: of the poses.
            found: bodies, and problems in words.
            grey: makes what the overlay is drawn on.
            begun: when work on the image began [s], of `perf_counter`.
        """
        sightings, problems = found
        self._detections.publish(encode_sightings(sightings, bodies, frame, message.header.stamp))
        if self._overlay.get_subscription_count():
            picture = draw_overlay(grey(), sightings, bodies, camera)
            self._overlay.publish(codec.encode_image(picture, "bgr8", message.header))
        took = f"{1e3 * (perf_counter() - begun):.0f} ms"
        level, text = (WARN, "; ".join(problems)) if problems else (OK, f"finds {self._what}")
        self.diagnostics.set(level, text, bodies_seen=len(sightings), time=took)
