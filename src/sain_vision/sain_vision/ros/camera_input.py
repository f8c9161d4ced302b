"""What nodes hear of a camera: images, their calibration, and where the camera is; or one look."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from sain_core.errors import InvalidInputError
from sain_core.guarding.ros.reception import LARGE_BYTES, Reception
from sain_core.ros import codec
from sain_core.ros.camera_topics import make_transform
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, NEWEST, TRANSFORMS
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel, check_calibration, check_view, rotation_of
from sain_vision.ros.settings import COLOUR_TOPICS, CameraInputConfig
from sain_vision.scene.frame_tree import FrameTree
from sain_vision.scene.scene_tracker import FUTURE

PATIENCE: Final = 5.0  # [s] for an image
OnImage = Callable[[Image, CameraModel], None]


class CameraInput:
    """Hands each image on with the camera that took it. Make it on the executor's thread."""

    def __init__(
        self,
        node: Node,
        reception: Reception,
        topics: tuple[str, str],
        config: CameraInputConfig,
        on_image: OnImage,
        refuse: Callable[[Any, BaseException], None],
        placed: bool = True,
    ) -> None:
        """Hear images and calibrations on two topics; where the camera is, from /tf.

        `refuse` is called with each message that is not used, and why. Of a camera that is not
        `placed` the pose is not needed, and the model has none.
        """
        self._node, self._max_age, self._on_image = node, config.max_age, on_image
        self._placed = placed
        self._image_topic, self._info_topic = topics
        self._tree = FrameTree(config.frame)
        self._info: CameraInfo | None = None
        self._unusable = ""  # why the latest calibration is not used
        self._viewed = b""  # the pose from which the table is seen
        self._stampless = Time()
        self._model: CameraModel | None = None  # of the latest calibration, without its pose
        reception.listen(CameraInfo, self._info_topic, self._on_info, NEWEST, refuse)
        reception.listen(TFMessage, "/tf", self._tree.take_message, TRANSFORMS, refuse)
        static = partial(self._tree.take_message, static=True)
        reception.listen(TFMessage, "/tf_static", static, LATCHED_QUEUE, refuse)
        reception.listen(Image, self._image_topic, self._on_frame, NEWEST, refuse, LARGE_BYTES)

    @property
    def missing(self) -> str:
        """What has not come yet, in words."""
        if self._info is None:
            return f"no calibration on {self._node.resolve_topic_name(self._info_topic)}"
        return f"no image on {self._node.resolve_topic_name(self._image_topic)}"

    def _on_info(self, message: CameraInfo) -> None:
        message.header.stamp = self._stampless
        if message == self._info:
            return
        self._info, self._model, self._viewed = message, None, b""
        try:
            self._model = self._calibrated(message)
            if self._model.misses_corners:
                self._node.get_logger().warning(
                    "the camera's lens has no inverse in the corners of the image: bodies are not"
                    " seen there; calibrate it with the board also in the corners"
                )
        except InvalidInputError as error:
            self._unusable = str(error)
            raise

    def _calibrated(self, message: CameraInfo) -> CameraModel:
        _check_raw(message, self._node.resolve_topic_name(self._image_topic))
        matrix = np.array(message.k, dtype=np.float64).reshape(3, 3)
        distortion = np.array(message.d, dtype=np.float64)
        size = int(message.width), int(message.height)
        return check_calibration(*size, matrix, message.distortion_model, distortion)

    def _on_frame(self, message: Image) -> None:
        self._check_time(codec.decode_time(message.header.stamp))
        if self._info is None:
            raise InvalidInputError(
                f"there is no calibration on {self._node.resolve_topic_name(self._info_topic)};"
                " the camera must publish its CameraInfo"
            )
        if self._model is None:
            raise InvalidInputError(self._unusable)
        if (message.width, message.height) != (self._model.width, self._model.height):
            raise InvalidInputError(
                f"the image is {message.width} x {message.height} px and its calibration is for"
                f" {self._model.width} x {self._model.height} px; both must be of one camera"
            )
        if not self._placed:
            self._on_image(message, self._model)
            return
        if not message.header.frame_id:
            raise InvalidInputError(
                "the image has no frame_id; the driver must state the camera's optical frame"
            )
        place, turn, _ = self._tree.transform(message.header.frame_id)
        camera = self._model.moved(rotation_of(turn), place)
        if (pose := np.concatenate([place, turn]).tobytes()) != self._viewed:
            check_view(camera, f"the camera {message.header.frame_id!r}")
            self._viewed = pose  # to look takes 3 ms
        self._on_image(message, camera)

    def _check_time(self, stamp: float) -> None:
        age = self._node.get_clock().now().nanoseconds * 1e-9 - stamp
        if age > self._max_age:
            raise InvalidInputError(
                f"the image is {age:.1f} s old; at most {self._max_age:g} s is allowed"
                + "; its stamp is 0: the driver must stamp images" * (stamp == 0.0)
            )
        if age < -self._max_age:
            raise InvalidInputError(f"the image is stamped {-age:.1f} s in the future; {FUTURE}")


def _check_raw(message: CameraInfo, topic: str) -> None:
    """Check that K and D of a calibration fit the images on a topic.

    Raises `InvalidInputError`: they are binned, a part of the sensor's image, or rectified.
    """
    binning, roi = (message.binning_x, message.binning_y), message.roi
    if max(binning) > 1:
        raise InvalidInputError(
            f"the calibration states a binning of {binning[0]} x {binning[1]}; only 1 x 1 is"
            " used: publish whole images, and calibrate them"
        )
    part = (roi.x_offset, roi.y_offset, roi.width, roi.height)
    if any(part) and part != (0, 0, message.width, message.height):
        raise InvalidInputError(
            f"the calibration states a region of interest of {roi.width} x {roi.height} px at"
            f" ({roi.x_offset}, {roi.y_offset}); only the whole of {message.width} x"
            f" {message.height} px is used: publish whole images, and calibrate them"
        )
    same = list(message.k) == [message.p[index] for index in (0, 1, 2, 4, 5, 6, 8, 9, 10)]
    if "rect" in topic.rpartition("/")[2] and not (same and not any(message.d)):
        raise InvalidInputError(
            f"the images on {topic} are rectified, and raw ones are needed: K and D are used, not"
            " P and R. Remap to the topic that ends in image_raw"
        )


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


def publish_place(node: Node, config: CameraInputConfig) -> None:
    """Publish where a camera is, as the file of its calibration has it; nothing without a file.

    Raises `ConfigError`: the file cannot be used.
    """
    if not config.extrinsics:
        return  # somebody else does
    pose = read_extrinsics(Path(config.extrinsics).expanduser(), config.frame)
    header = Header(stamp=node.get_clock().now().to_msg(), frame_id=pose.parent)
    one = make_transform(header, pose.frame, pose.place, pose.turn)
    node.create_publisher(TFMessage, "/tf_static", LATCHED).publish(TFMessage(transforms=[one]))
