"""`calibrate_camera`, end to end: ten looks at a printed board, over topics, by a simulated camera.

    ./env python -m benchmarks.results.calibrating

The pose of the camera that is believed is wrong on purpose. Afterwards tags on bodies are placed by
the wrong pose and by the calibrated one.
"""

import tempfile
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import rclpy
import tyro
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rich.console import Console

from benchmarks.report import Figure, report
from benchmarks.results.seeing import AWAY, errors_of, model_of
from sain_core.camera.image_camera import Drawing, ImageCamera, ImageCameraConfig
from sain_core.randomness import generator
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.node_main import NAMESPACE
from sain_core.scene import DISK_HEIGHT, make_scene
from sain_core.shapes.body_file import Tag, parse_bodies
from sain_core.types import Scene
from sain_vision.detection.board import Board
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel, rotation_of
from sain_vision.ros import calibrate_camera

FIRST = (0.45, -0.1, 0.0)  # pose of the board in the first look
PERIOD = 0.2  # [s], between images


@dataclass(frozen=True)
class Options:
    """How wrong the pose is, and with how many looks that is mended."""

    misplaced: tuple[float, float, float] = (0.008, -0.005, 0.006)
    """[m]"""
    misturned: tuple[float, float, float] = (0.006, -0.004, 0.005)
    """[rad]"""
    distortion: tuple[float, float, float, float, float] = (0.08, -0.1, 0.0005, 0.0005, 0.0)
    """of the lens, which the CameraInfo states"""
    seed: int = 0
    """of noise and places"""
    out: Path | None = None
    """Write the figures to this JSON file."""


class Paper:
    """An `ImageRenderer` of a bare table."""

    def drawing(self, joints: np.ndarray, scene: Scene, width: int, height: int) -> Drawing:
        """Return a grey table."""
        colour = np.full((height, width, 3), 190, dtype=np.uint8)
        return Drawing(colour, np.ones((height, width)), np.zeros((height, width), dtype=bool))

    def close(self) -> None:
        """Nothing is held."""


class BoardCamera(Node):
    """Publishes images of a board on the table."""

    def __init__(
        self, config: ImageCameraConfig, board: Board, seed: int, context: rclpy.Context
    ) -> None:
        super().__init__("camera", namespace=NAMESPACE, context=context)
        x, y, z = config.eye
        # Tags are painted as high as bodies are: this camera and its focus are as much higher.
        focus = (config.focus[0], config.focus[1], config.focus[2] + DISK_HEIGHT)
        raised = replace(config, eye=(x, y, z + DISK_HEIGHT), focus=focus)
        tags = [
            Tag(number, board.size, *corners.mean(axis=0).tolist())
            for number, corners in board.corners().items()
        ]
        self._camera = ImageCamera(raised, Paper(), [tags])
        self._topics = CameraTopics(self, config)
        self._random = generator(seed, "board")
        self.pose = np.array(FIRST)
        self.create_timer(PERIOD, self._show)

    def turn_board(self) -> None:
        """Lay the board anywhere."""
        places = self._random.uniform([0.3, -0.45, -np.pi], [0.8, 0.35, np.pi])
        self.pose = places

    def _show(self) -> None:
        scene = make_scene(self.pose[None, :2], np.ones(1), np.full(1, 0.1), self.pose[2:])
        shot = self._camera.take(AWAY, scene, self._random)
        self._topics.publish(shot, self.get_clock().now().to_msg())


def calibrated(options: Options, config: ImageCameraConfig, folder: Path) -> CameraModel:
    """Return the camera at the place that `calibrate_camera` finds."""
    given = calibrate_camera.CalibrateOptions(out=folder / "camera.yaml", origin=FIRST)
    context = rclpy.Context()
    rclpy.init(context=context)
    node = BoardCamera(config, Board(), options.seed, context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()

    def wait(options: calibrate_camera.CalibrateOptions, console: Console, text: str) -> None:
        console.print(text)
        if "somewhere else" in text:
            node.turn_board()
        time.sleep(4 * PERIOD)  # images of the board where it was are gone

    calibrate_camera._wait = wait  # a person moves the board and presses Enter
    try:
        calibrate_camera.run(given, Console())
    finally:
        executor.shutdown()
        thread.join()
        rclpy.try_shutdown(context=context)
    pose = read_extrinsics(given.out)
    return model_of(config).moved(rotation_of(pose.turn), pose.place)


def tag_errors(camera: CameraModel, config: ImageCameraConfig, seed: int) -> np.ndarray:
    """Return errors (E, 4) of tags of 40 mm all over the table, by a camera at a believed pose."""
    random, settings, errors = generator(seed, "tags"), TagConfig(), []
    bodies = parse_bodies(
        {"bodies": [{"shape": "disk", "radius": 0.06, "tags": body} for body in range(6)]}
    )
    taker = ImageCamera(config, Paper(), bodies.tags)
    finder, locator = TagFinder(settings), TagLocator(bodies, settings)
    for _ in range(20):
        poses = random.uniform([0.3, -0.4, -np.pi], [0.85, 0.4, np.pi], (6, 3))
        if min(np.hypot(*(a - b)[:2]) for i, a in enumerate(poses) for b in poses[:i]) < 0.08:
            continue
        scene = make_scene(poses[:, :2], np.ones(6), np.full(6, 0.06), poses[:, 2])
        grey = cv2.cvtColor(taker.take(AWAY, scene, random).colour, cv2.COLOR_RGB2GRAY)
        errors += errors_of(locator.locate(finder.find(np.asarray(grey)), camera)[0], scene)
    return np.array(errors)


def main() -> None:
    """Measure."""
    options = tyro.cli(Options, description=__doc__)
    cv2.setNumThreads(1)
    true = replace(ImageCameraConfig(), distortion=options.distortion)
    wrong = replace(true, misplaced=options.misplaced, misturned=options.misturned)
    with tempfile.TemporaryDirectory() as folder:
        camera = calibrated(options, wrong, Path(folder))
    place = 1e3 * np.linalg.norm(camera.place - true.eye)
    turn, _ = cv2.Rodrigues(true.rotation.T @ camera.rotation)
    before, after = (
        1e3 * np.hypot(*tag_errors(one, true, options.seed).T[:2])
        for one in (model_of(wrong), camera)
    )
    figures = [
        Figure("tags by the wrong pose, p95", float(np.quantile(before, 0.95)), "mm"),
        Figure(
            "tags by the calibrated pose, p95", float(np.quantile(after, 0.95)), "mm", at_most=1.5
        ),
        Figure("place of the camera, error", float(place), "mm"),
        Figure("turn of the camera, error", float(np.degrees(np.linalg.norm(turn))), "deg"),
    ]
    report("calibrate_camera over topics, pose wrong on purpose", figures, options.out)


if __name__ == "__main__":
    main()
