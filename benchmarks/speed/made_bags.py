"""Bags of any size for benchmarks: pushes with their results, or a whole graph at work.

The messages have the sizes of a recording of `make demo`. The states of pushes are random, so that
they compress no better than real ones; of what else a graph says a few numbers change each time.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from sain_bags.writing.messages import MessageMaker
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.randomness import generator
from sain_core.scene import STATE_NAMES

BESIDE = {  # what else a graph says for each scene, with its size [bytes] in CDR
    "/clock": ("rosgraph_msgs/msg/Clock", 12),
    "/sain/joint_states": ("sensor_msgs/msg/JointState", 296),
    "/sain/markers": ("visualization_msgs/msg/MarkerArray", 1404),
}
CHANGING = 128  # [bytes] of each of these that are not as before
PUSHES_AN_EPISODE = 8
PERIOD = 10_000_000  # [ns] between scenes
FRAME = 33_000_000  # [ns] between images
IMAGE = "sensor_msgs/msg/Image"


class MadeBag:
    """Writes one bag."""

    def __init__(self, folder: Path, config: BagConfig = BagConfig(), seed: int = 0) -> None:
        """Begin a bag in a new folder."""
        self.writer, self._random = BagWriter(folder, config), generator(seed, 0)
        self._messages = MessageMaker()
        self._now, self._scene_id = 1_700_000_000_000_000_000, 0
        self._bodies = self._disks()  # as the last push left them

    def pushes(self, count: int, first: int = 1) -> None:
        """Write pushes, each planned from the scene that the one before led to."""
        for number in range(first, first + count):
            episode = 1 + number // PUSHES_AN_EPISODE
            if not self._scene_id or number % PUSHES_AN_EPISODE == 0:
                self._scene_id += 1
                poses = [self._make("GoalPose", body=1, x=0.8, y=0.1, tolerance=0.02)]
                self._send("goal", "Goal", goal_id=episode, episode_id=episode, poses=poses)
                self._bodies = self._disks()
            self._push(number, episode)

    def scenes(self, count: int) -> None:
        """Write scenes of something that moves, at 100 Hz, and what else a graph says."""
        message = self._scene(1, settled=False)
        data = self._messages.data(message)
        for _ in range(count):
            self._write("/sain/scene", "sain_interfaces/msg/Scene", data, PERIOD)
            for topic, (kind, size) in BESIDE.items():
                fresh = self._random.bytes(min(size, CHANGING))
                self._write(topic, kind, bytes(size - len(fresh)) + fresh, 0)

    def images(self, pictures: Iterable[np.ndarray]) -> None:
        """Write what a camera sees (H, W, 3), 30 times a second."""
        for pixels in pictures:
            height, width, _ = pixels.shape
            about = {"height": height, "width": width, "encoding": "rgb8", "step": 3 * width}
            image = self._messages.make(IMAGE, **about, data=pixels.ravel())
            data = self._messages.data(image)
            self._write("/sain/camera/color/image_raw", IMAGE, data, FRAME)

    def _push(self, number: int, episode: int) -> None:
        ids: dict[str, Any] = {"push_id": number, "episode_id": episode}
        angles = self._random.uniform(-0.7, 0.7, 2)
        before = self._scene(episode)
        self._bodies = self._disks()
        push = self._make(
            "Push", **ids, scene_id=self._scene_id, location=angles[0], angle=angles[1],
            length=0.1, source="mppi",
        )  # fmt: skip
        self._write("/sain/push", push.__msgtype__, self._messages.data(push))
        self._scene_id += 1
        after = self._scene(episode)
        prediction = self._make(
            "Prediction", error_code=1, model="bullet_nominal", disks=self._disks()
        )
        self._send(
            "push_result", "PushResult", **ids, error_code=1, push=push, before=before,
            after=after, duration=1.25, prediction=prediction,
        )  # fmt: skip

    def _scene(self, episode: int, settled: bool = True) -> Any:
        header = self._messages.make("std_msgs/msg/Header", frame_id="world")
        return self._make(
            "Scene", header=header, episode_id=episode, scene_id=self._scene_id, settled=settled,
            disks=self._bodies,
        )  # fmt: skip

    def _disks(self) -> list[Any]:
        poses = self._random.uniform(0.2, 0.8, (2, 3))
        values = ([*pose, 0.0, 0.0, 0.0, 8.0, 0.06] for pose in poses.tolist())
        return [
            self._make("DiskState", **dict(zip(STATE_NAMES, disk, strict=True))) for disk in values
        ]

    def _make(self, name: str, **fields: Any) -> Any:
        return self._messages.make(f"sain_interfaces/msg/{name}", **fields)

    def _send(self, topic: str, name: str, **fields: Any) -> None:
        message = self._make(name, **fields)
        self._write(f"/sain/{topic}", message.__msgtype__, self._messages.data(message))

    def _write(self, topic: str, kind: str, data: bytes, wait: int = 1_000_000) -> None:
        if topic not in self.writer.counts:
            self.writer.add_topic(self._messages.topic(topic, kind))
        self._now += wait + 1
        self.writer.write(topic, data, self._now)
