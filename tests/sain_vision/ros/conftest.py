"""A camera on topics: images, calibration and extrinsics."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray

from sain_core.ros import codec
from sain_core.ros.qos import LATCHED
from sain_vision.optics import CameraModel
from tests.sain_vision.pictures import CAMERA

PERIOD = 0.08  # [s]
FRAME = "camera_color_optical_frame"


class CameraTopics:
    """Publishes what a camera does, as realsense2_camera names it."""

    def __init__(self, graph: Any, camera: CameraModel = CAMERA) -> None:
        self.graph, self.camera, node = graph, camera, graph.bystander
        self.image_frame = FRAME
        self.late, self.calibrated, self.encoding = 0.0, True, "mono8"
        self.changes: dict[str, Any] = {}  # of the calibration
        for topic, kind in (("/diagnostics", DiagnosticArray), ("detections", Detection3DArray)):
            graph.listen(topic, kind)
        self.images = node.create_publisher(Image, "camera/color/image_raw", 1)
        self.infos = node.create_publisher(CameraInfo, "camera/color/camera_info", 1)
        self.static = node.create_publisher(TFMessage, "/tf_static", LATCHED)

    def place(self, frame: str = FRAME) -> None:
        """Publish where the camera is."""
        x, y, z, w = Rotation.from_matrix(self.camera.rotation).as_quat().tolist()
        place = Vector3(**dict(zip("xyz", self.camera.place.tolist(), strict=True)))
        one = TransformStamped(
            header=codec.header(codec.encode_time(0)),
            child_frame_id=frame,
            transform=Transform(translation=place, rotation=Quaternion(x=x, y=y, z=z, w=w)),
        )
        self.static.publish(TFMessage(transforms=[one]))

    def show(self, picture: np.ndarray) -> None:
        """Publish one image, with its calibration."""
        now = self.graph.bystander.get_clock().now().nanoseconds
        header = codec.header(codec.encode_time(max(now - round(1e9 * self.late), 0)))
        header.frame_id = self.image_frame
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

    def until(self, picture: np.ndarray, done: Any, what: str) -> None:
        """Publish one image again and again until something is so."""

        def shown() -> bool:
            self.show(picture)
            self.graph.spin(PERIOD)
            return bool(done())

        self.graph.wait(shown, what)

    def says(self, text: str) -> bool:
        return any(text in s.message for m in self.graph.heard["/diagnostics"] for s in m.status)

    def cropped(self) -> None:
        """Take another camera, as a calibration of another size has it."""
        self.camera = replace(self.camera, width=1200)


@pytest.fixture
def camera_topics(graph):
    return CameraTopics(graph)
