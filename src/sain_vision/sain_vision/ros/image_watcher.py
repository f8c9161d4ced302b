"""The next image of a camera, on request."""

import time
from typing import Any, Final

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Image

from sain_core.errors import InvalidInputError
from sain_core.guarding.ros.reception import Reception
from sain_vision.optics import CameraModel
from sain_vision.ros.camera_input import CameraInput
from sain_vision.ros.settings import COLOUR_TOPICS, CameraInputConfig

PATIENCE: Final = 5.0  # [s] for an image


class ImageWatcher:
    """Takes the next image of a camera on request."""

    def __init__(
        self, node: Node, topics: tuple[str, str] = COLOUR_TOPICS, placed: bool = False
    ) -> None:
        """Listen to a camera, whose pose comes from /tf if it is to be `placed`."""
        self._node = node
        self.problem = ""
        self._latest: tuple[Image, CameraModel] | None = None
        self._input = CameraInput(
            node, Reception(node), topics, CameraInputConfig(), self._on_image, self._ignore,
            placed=placed,
        )  # fmt: skip

    def next_image(self) -> tuple[Image, CameraModel]:
        """Return the next image.

        Raises `InvalidInputError`: none comes, or what comes is not used, and why.
        """
        self._latest, self.problem = None, ""
        end = time.monotonic() + PATIENCE
        while self._latest is None:
            if time.monotonic() > end:
                raise InvalidInputError(self.problem or self._input.missing)
            rclpy.spin_once(self._node, timeout_sec=0.05)
        return self._latest

    def _on_image(self, message: Image, camera: CameraModel) -> None:
        self._latest = message, camera

    def _ignore(self, message: Any, error: BaseException) -> None:
        self.problem = str(error)
