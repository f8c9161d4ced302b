"""The camera over the laboratory's table: topics as of a real one, images on their own thread."""

from concurrent.futures import Future
from functools import cached_property

from builtin_interfaces.msg import Time
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from sain_arm.laboratory.cell import Cell
from sain_arm.laboratory.sight import LaboratoryView
from sain_core.camera.image_camera import ImageCamera, ImageCameraConfig, Shot
from sain_core.errors import ConfigError
from sain_core.randomness import generator
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import LATCHED
from sain_core.ros.worker import Worker
from sain_core.scene import DISK_HEIGHT


class LaboratoryCamera:
    """Publishes images while somebody subscribes; the simulation goes on during this time."""

    def __init__(self, node: Node, cell: Cell, config: ImageCameraConfig, seed: int) -> None:
        """Stand over the table of a cell, and tell where."""
        for body, height in enumerate(cell.bodies.heights):
            if cell.bodies.tags[body] and abs(height - DISK_HEIGHT) > 1e-6:
                raise ConfigError(
                    f"{cell.bodies.called(body)} has a height of {height:g} m; bodies of the"
                    f" laboratory are {DISK_HEIGHT:g} m high, and tags lie on their tops"
                )
        self._node, self._cell, self._config = node, cell, config
        self._random = generator(seed, "images")
        self._topics = CameraTopics(node, config)
        self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        stamp = node.get_clock().now().to_msg()
        self._static.publish(TFMessage(transforms=[self._topics.transform(stamp)]))
        self._worker, self._is_busy = Worker(node, "camera"), False
        steady_timer(node, 1.0 / config.rate, self._look)

    @cached_property
    def _camera(self) -> ImageCamera:
        """The camera, made on its thread with the first image: most laboratories take none."""
        view = LaboratoryView(self._cell, self._config)
        return ImageCamera(self._config, view, self._cell.bodies.tags)

    def _look(self) -> None:
        if self._is_busy or not self._topics.wanted:
            return
        self._is_busy = True
        joints, scene = self._cell.joints, self._cell.observe()
        stamp = self._node.get_clock().now().to_msg()
        self._worker.submit(
            lambda: self._camera.take(joints, scene, self._random),
            lambda done: self._publish(done, stamp),
        )

    def _publish(self, done: "Future[Shot]", stamp: Time) -> None:
        self._is_busy = False
        self._topics.publish(done.result(), stamp)

    def close(self) -> None:
        """End the thread."""
        self._worker.close()
