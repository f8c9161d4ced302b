"""What publishes beside a node: a camera, with images, calibration and extrinsics, or poses."""

from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray

from sain_core.ros import codec
from sain_core.ros.camera_topics import make_transform
from sain_core.ros.qos import LATCHED
from sain_vision.optics import turn_of
from tests.sain_vision.pictures import CAMERA

PERIOD = 0.08  # [s]
FRAME = "camera_color_optical_frame"


class Source:
    """Something that sees bodies, with stamps that may be late [s]."""

    def __init__(self, graph: Any, frame: str) -> None:
        self.graph, self.frame, self.late = graph, frame, 0.0
        graph.listen("/diagnostics", DiagnosticArray)

    def header(self) -> Any:
        now = self.graph.bystander.get_clock().now().nanoseconds
        header = codec.header(codec.encode_time(max(now - round(1e9 * self.late), 0)))
        header.frame_id = self.frame
        return header

    def until(self, send: Any, done: Any, what: str, period: float = 0.02) -> None:
        """Send again and again until something is so."""

        def sent() -> bool:
            send()
            self.graph.spin(period)
            return bool(done())

        self.graph.wait(sent, what)

    def says(self, text: str) -> bool:
        return any(text in s.message for m in self.graph.heard["/diagnostics"] for s in m.status)


class CameraTopics(Source):
    """Publishes what a camera does, as realsense2_camera names it."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, FRAME)
        self.camera, node = CAMERA, graph.bystander
        self.calibrated, self.encoding = True, "mono8"
        self.changes: dict[str, Any] = {}  # of the calibration
        graph.listen("detections", Detection3DArray)
        self.images = node.create_publisher(Image, "camera/color/image_raw", 1)
        self.infos = node.create_publisher(CameraInfo, "camera/color/camera_info", 1)
        self.static = node.create_publisher(TFMessage, "/tf_static", LATCHED)

    def place(self, frame: str = FRAME) -> None:
        """Publish where the camera is."""
        header, turn = codec.header(codec.encode_time(0)), turn_of(self.camera.rotation)
        one = make_transform(header, frame, self.camera.place, turn)
        self.static.publish(TFMessage(transforms=[one]))

    def show(self, picture: np.ndarray) -> None:
        """Publish one image, with its calibration."""
        header = self.header()
        if self.calibrated:
            stated = {
                "width": self.camera.width,
                "height": self.camera.height,
                "distortion_model": "plumb_bob",
                "d": self.camera.distortion.tolist(),
                "k": self.camera.matrix.ravel(),
            }
            self.infos.publish(CameraInfo(header=header, **(stated | self.changes)))
        self.images.publish(codec.encode_image(picture, self.encoding, header))

    def show_until(self, picture: np.ndarray, done: Any, what: str) -> None:
        """Publish one image again and again until something is so."""
        self.until(lambda: self.show(picture), done, what, PERIOD)


@pytest.fixture
def camera_topics(graph):
    return CameraTopics(graph)
