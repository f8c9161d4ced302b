"""A camera's topics, as realsense2_camera names them, and its frame."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from jaxtyping import Float
from numpy import ndarray
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from sain_core.camera.image_camera import ImageCameraConfig, Shot
from sain_core.errors import SainError
from sain_core.guarding.ros.reception import shortened
from sain_core.ros import codec
from sain_core.ros.qos import RELIABLE
from sain_core.ros.worker import Worker

COLOUR: Final = "camera/color/image_raw"
INFO: Final = "camera/color/camera_info"
DEPTH: Final = "camera/aligned_depth_to_color/image_raw"
OPTICAL_FRAME: Final = "camera_color_optical_frame"


def make_transform(
    header: Header, child: str, place: Float[ndarray, "3"], turn: Float[ndarray, "4"]
) -> TransformStamped:
    """Return where a frame is in another one: its place [m] and its turn as x, y, z, w."""
    (x, y, z), (a, b, c, w) = place.tolist(), turn.tolist()
    made = TransformStamped(header=header, child_frame_id=child)
    made.transform.translation = Vector3(x=x, y=y, z=z)
    made.transform.rotation = Quaternion(x=a, y=b, z=c, w=w)
    return made


class CameraTopics:
    """Publishes images, and tells whether anybody hears them."""

    def __init__(self, node: Node, config: ImageCameraConfig, frame_prefix: str = "") -> None:
        """Create the publishers."""
        self._node, self._config, self._frame = node, config, frame_prefix + OPTICAL_FRAME
        self._colour = node.create_publisher(Image, COLOUR, RELIABLE)
        self._info = node.create_publisher(CameraInfo, INFO, RELIABLE)
        self._depth = node.create_publisher(Image, DEPTH, RELIABLE)

    @property
    def wanted(self) -> bool:
        """Whether somebody subscribes to images."""
        return any(one.get_subscription_count() for one in (self._colour, self._depth))

    def transform(self, stamp: Time) -> TransformStamped:
        """Return where the camera is, as its calibration has it."""
        rotation, place = self._config.stated_pose
        turn = Rotation.from_matrix(rotation).as_quat()
        return make_transform(codec.header(stamp), self._frame, place, turn)

    def take(self, worker: Worker, shoot: Callable[[], Shot], stamp: Time) -> None:
        """Take images on a worker's thread and publish them; log what hinders that."""

        def publish(done: "Future[Shot]") -> None:
            if isinstance(error := done.exception(), SainError):
                text = f"no images: {shortened(str(error))}"
                self._node.get_logger().error(text, throttle_duration_sec=10.0)
            else:
                self.publish(done.result(), stamp)

        worker.submit(shoot, publish)

    def publish(self, shot: Shot, stamp: Time) -> None:
        """Publish images that were taken at a time, with their calibration."""
        header = codec.header(stamp)
        header.frame_id = self._frame
        matrix = self._config.matrix
        projection = np.column_stack([matrix, np.zeros(3)])
        self._info.publish(
            CameraInfo(
                header=header,
                width=self._config.width,
                height=self._config.height,
                distortion_model="plumb_bob",
                d=list(self._config.distortion),
                k=matrix.ravel(),
                r=np.eye(3).ravel(),
                p=projection.ravel(),
            )
        )
        for publisher, pixels, encoding in (
            (self._colour, shot.colour, "rgb8"),
            (self._depth, shot.depth, "16UC1"),
        ):
            if publisher.get_subscription_count():
                publisher.publish(codec.encode_image(pixels, encoding, header))
