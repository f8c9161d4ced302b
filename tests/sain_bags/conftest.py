"""Recordings made by hand: CDR from `rosbags`' typestore, so that no test needs a running graph."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sain_bags.writing.messages import MessageMaker
from sain_bags.writing.writer import BagWriter
from sain_core.push import make_push
from sain_core.scene import STATE_NAMES, make_scene
from sain_core.types import Scene

INTERFACES = (
    "DiskState", "Scene", "GoalPose", "Goal", "Push", "Prediction", "PushResult",
    "Plan", "WorldParameters", "Body", "Bodies",
)  # fmt: skip
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


class Messages(MessageMaker):
    """Builds and serializes messages of the graph."""

    def __init__(self) -> None:
        super().__init__()
        for name in INTERFACES:
            self._kind(f"sain_interfaces/msg/{name}")

    def disks(self, scene: Scene) -> list[Any]:
        """Return a scene as ``DiskState[]``."""
        return [
            self.make("sain_interfaces/msg/DiskState", **dict(zip(STATE_NAMES, row, strict=True)))
            for row in scene.tolist()
        ]

    def poses(self, x: float, y: float = 0.0, body: int = 1, **more: Any) -> list[Any]:
        """Return the poses of the goal that brings one body to a place, with any heading."""
        about = {"body": body, "x": float(x), "y": float(y), "tolerance": 0.02, **more}
        return [self.make("sain_interfaces/msg/GoalPose", **about)]


class Recording:
    """A bag under construction, one message every 100 ms."""

    def __init__(self, writer: BagWriter, messages: Messages) -> None:
        self.writer, self.messages = writer, messages
        self.now = START

    def add(self, topic: str, short: str, **fields: Any) -> None:
        """Append a message of ``sain_interfaces``."""
        type_name = short if "/" in short else f"sain_interfaces/msg/{short}"
        data = self.messages.data(self.messages.make(type_name, **fields))
        self.writer.add_topic(self.messages.topic(topic, type_name))
        self.now += SECOND // 10
        self.writer.write(topic, data, self.now, self.now - 1000)

    def scene(self, episode: int, scene_id: int, scene: Scene, settled: bool = True) -> None:
        """Append a scene."""
        disks = self.messages.disks(scene)
        self.add(
            "/sain/scene", "Scene",
            episode_id=episode, scene_id=scene_id, settled=settled, disks=disks,
        )  # fmt: skip

    def push(self, number: int, episode: int, before: Scene, after: Scene, **more: Any) -> None:
        """Append all that a push leaves behind: plan and result."""
        make, disks = self.messages.make, self.messages.disks
        code = more.get("error_code", 1)
        predicted = np.stack([after + 0.001, after + 0.002])
        pushes = make_push(0.1, 0.1, [0.1, 0.1])
        plan = {
            "plan_id": number, "push_id": number, "episode_id": episode, "status": 1,
            "error_code": 1, "goal_id": more.get("goal_id", episode), "dynamics": "planar",
            "horizon": 2, "disks": len(before), "pushes": pushes.ravel(),
            "predicted": predicted.ravel(), "planning_time": 0.25,
        }  # fmt: skip
        if more.get("planned", True):
            self.add("/sain/plan", "Plan", **plan)
        push = make(
            "sain_interfaces/msg/Push",
            push_id=number,
            location=more.get("location", 0.3),
            length=0.1,
        )
        scenes = [make("sain_interfaces/msg/Scene", disks=disks(s)) for s in (before, after)]
        prediction = {"model": "bullet_nominal", "error_code": 1, "disks": disks(after + 0.003)}
        if code != 1 or not more.get("predicts", True):
            prediction = {}
        self.add(
            "/sain/push_result", "PushResult",
            push_id=number, episode_id=episode, error_code=code, push=push,
            error_message="blocked" if code != 1 else "", before=scenes[0], after=scenes[1],
            prediction=make("sain_interfaces/msg/Prediction", **prediction),
        )  # fmt: skip


@pytest.fixture(scope="session")
def messages() -> Messages:
    return Messages()


@pytest.fixture
def record(messages: Messages, tmp_path: Path) -> Iterator[Callable[..., Recording]]:
    """Start recordings; the caller closes their writers, or they are closed at the end."""
    writers = []

    def start(name: str = "bag", **options: Any) -> Recording:
        writer = BagWriter(tmp_path / name, **options)
        writers.append(writer)
        return Recording(writer, messages)

    yield start
    for writer in writers:
        writer.close()


@pytest.fixture
def episode_bag(record: Callable[..., Recording], messages: Messages, tmp_path: Path) -> Path:
    """A bag of two episodes: three pushes, one of them refused, then one without a push."""
    recording = record(custom_data={"seed": "7"})
    for episode in (2, 3):
        start = resting_scene(0.45)
        recording.scene(episode, 10 * episode, start)
        recording.add(
            "/sain/goal", "Goal",
            goal_id=episode, episode_id=episode, poses=messages.poses(0.80), max_pushes=15,
        )  # fmt: skip
        if episode == 2:
            nearer, there = resting_scene(0.60), resting_scene(0.79)
            recording.push(1, 2, start, nearer)
            recording.push(2, 2, nearer, nearer, error_code=9, location=float("nan"))
            recording.push(3, 2, nearer, there)
            recording.scene(2, 22, there, settled=True)
    recording.writer.close()
    return tmp_path / "bag"


def resting_scene(target_x: float) -> Scene:
    """Two disks at rest, the target at (target_x, 0)."""
    positions = np.array([[target_x - 0.15, 0.0], [target_x, 0.0]])
    return make_scene(positions, np.full(2, 8.0), np.array([0.08, 0.06]))
