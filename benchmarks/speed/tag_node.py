"""How fast the node of tags is: images of 1280 x 720 px in, poses out, over topics.

The node runs as a process on one core. Images follow each other as soon as poses come, and then at
ten a second. Processor time hardly depends on who else uses the machine; times on the clock do.
"""

import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import rclpy
from rclpy.node import Node
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.results.seeing import AWAY, scenes
from benchmarks.results.seeing import Options as SeeingOptions
from sain_core.camera.image_camera import ImageCameraConfig, Shot
from sain_core.cli.command_line import command_of_node
from sain_core.randomness import generator
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.node_main import ros_context
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import write_tagged_bodies
from sain_sim.camera.render import image_camera

NAMESPACE = "tag_benchmark"
PERIOD = 0.1  # [s]
PATIENCE = 30.0  # [s]


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    images: int = 100
    """Images of each part."""


class Camera(Node):
    """Publishes images of one scene, and takes the times of the poses."""

    def __init__(self, shots: list[Shot]) -> None:
        super().__init__("camera", namespace=NAMESPACE)
        self.shots, self.sent = shots, 0
        self.answered: dict[tuple[int, int], tuple[float, int]] = {}
        self.topics = CameraTopics(self, ImageCameraConfig(), "")
        self.static = self.create_publisher(TFMessage, "/tf_static", LATCHED)
        stamp = self.get_clock().now().to_msg()
        self.static.publish(TFMessage(transforms=[self.topics.transform(stamp)]))
        self.create_subscription(Detection3DArray, "detections", self._on_poses, RELIABLE)

    def show(self) -> tuple[int, int]:
        stamp = self.get_clock().now().to_msg()
        self.topics.publish(self.shots[self.sent % len(self.shots)], stamp)
        self.sent += 1
        return stamp.sec, stamp.nanosec

    def _on_poses(self, message: Detection3DArray) -> None:
        stamp = message.header.stamp
        now = self.get_clock().now().nanoseconds * 1e-9
        late = now - stamp.sec - 1e-9 * stamp.nanosec
        self.answered[stamp.sec, stamp.nanosec] = (late, len(message.detections))

    def wait(self, stamp: tuple[int, int], seconds: float) -> bool:
        end = time.monotonic() + seconds
        while stamp not in self.answered and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.01)
        return stamp in self.answered


def take(folder: Path) -> tuple[list[Shot], Path]:
    """Return images of a scene, and the file of its bodies."""
    scene = next(scenes(SeeingOptions(images=1)))
    count, random = len(scene), generator(0, "tag_node")
    path = folder / "bodies.yaml"
    write_tagged_bodies(path, scene, Bodies.named(("disk",) * count))
    with image_camera(ImageCameraConfig(), scene, ("disk",) * count) as camera:
        return [camera.take(AWAY, scene, random) for _ in range(8)], path


def main() -> None:
    """Measure."""
    options = read_options(Options, __doc__)
    with tempfile.TemporaryDirectory() as name, ros_context(args=[]):
        shots, bodies = take(Path(name))
        camera = Camera(shots)
        arguments = ["-r", f"__ns:=/{NAMESPACE}"]
        node = subprocess.Popen(
            command_of_node("sain_vision", "tag_node", arguments, bodies=bodies),
        )
        try:
            process = psutil.Process(node.pid)
            process.cpu_affinity([0])
            figures = measure(camera, process, options)
        finally:
            node.terminate()
            node.wait()
            camera.destroy_node()
    report("tag_node at 1280 x 720 px, six tags, on one core", figures, options.out)


def measure(camera: Camera, process: psutil.Process, options: Options) -> list[Figure]:
    """Return the figures of a node that has just been started."""
    end = time.monotonic() + PATIENCE
    while not camera.wait(camera.show(), 0.5):
        if time.monotonic() > end:
            raise SystemExit("tag_node sends no poses")
    before, begun = sum(process.cpu_times()[:2]), time.monotonic()
    stamps = []
    for _ in range(options.images):
        stamps.append(camera.show())
        camera.wait(stamps[-1], 1.0)
    spent = time.monotonic() - begun
    done = sum(stamp in camera.answered for stamp in stamps)
    used = (sum(process.cpu_times()[:2]) - before) / max(done, 1)
    steady = []
    for _ in range(options.images):
        began = time.monotonic()
        steady.append(camera.show())
        while time.monotonic() < began + PERIOD:
            rclpy.spin_once(camera, timeout_sec=0.01)
    camera.wait(steady[-1], 1.0)
    late = [camera.answered[stamp][0] for stamp in steady if stamp in camera.answered]
    found = [camera.answered[stamp][1] for stamp in stamps if stamp in camera.answered]
    return [
        Figure("images a second of processor time", 1 / used, "1/s", at_least=10),
        Figure("images a second, one after the other", done / spent, "1/s", at_least=10),
        Figure("latency at 10 images a second, median", 1e3 * float(np.median(late)), "ms"),
        Figure(
            "latency at 10 images a second, p95",
            1e3 * float(np.quantile(late, 0.95)),
            "ms",
            at_most=150,
        ),
        Figure("images at 10 a second that were answered", 100 * len(late) / len(steady), "%"),
        Figure("tags found in an image, mean", float(np.mean(found)), ""),
    ]


if __name__ == "__main__":
    main()
