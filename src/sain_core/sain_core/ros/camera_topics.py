"""A camera's topics, as realsense2_camera names them, and its frame."""

from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, Image

from sain_core.camera.image_camera import ImageCameraConfig, Shot
from sain_core.ros import codec
from sain_core.ros.qos import RELIABLE

COLOUR: Final = "camera/color/image_raw"
INFO: Final = "camera/color/camera_info"
DEPTH: Final = "camera/aligned_depth_to_color/image_raw"
OPTICAL_FRAME: Final = "camera_color_optical_frame"


class CameraTopics:
    """Publishes images, and tells whether anybody hears them."""

    def __init__(self, node: Node, config: ImageCameraConfig, frame_prefix: str = "") -> None:
        """Create the publishers."""
        self._config, self._frame = config, frame_prefix + OPTICAL_FRAME
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
        x, y, z = place.tolist()
        one = TransformStamped(header=codec.header(stamp), child_frame_id=self._frame)
        one.transform.translation = Vector3(x=x, y=y, z=z)
        a, b, c, w = Rotation.from_matrix(rotation).as_quat().tolist()
        one.transform.rotation = Quaternion(x=a, y=b, z=c, w=w)
        return one

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
