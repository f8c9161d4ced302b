"""Recordings of a whole graph at work, as the simulator's node leaves them behind."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sain_core.scene import make_scene
from sain_core.types import Scene

OK, BLOCKED, DUPLICATE = 1, 9, 7


@dataclass(frozen=True)
class Parts:
    """What the recording lacks or has otherwise; numbers are places in the episode."""

    results: bool = True
    unanswered: tuple[int, ...] = ()  # pushes without a result
    unpredicted: tuple[int, ...] = ()
    failed_prediction: tuple[int, ...] = ()
    unsettled: tuple[int, ...] = ()  # the scene after the push
    still: tuple[int, ...] = ()  # the target does not move
    predictions: bool = True
    scenes: bool = True
    namespace: str = "/sain"
    disks: int = 2


class Drive:
    """Writes episodes of pushes into a recording; same seed, same episodes."""

    def __init__(self, recording: Any, parts: Parts = Parts(), seed: int = 0) -> None:
        self.recording, self.parts = recording, parts
        self.messages = recording.messages
        self.random = np.random.default_rng(seed)
        self.scene_id, self.stamp = 0, 0.0

    def episode(self, number: int, ids: Sequence[int]) -> None:
        """Write one episode with a push for each id."""
        self.scene_id += 1
        scene = self.random_scene()
        poses = self.messages.poses(0.1 * number, 0.2)
        self._send("goal", "Goal", goal_id=number, episode_id=number, poses=poses)
        self.show(number, scene)
        for place, push_id in enumerate(ids):
            scene = self.push(number, push_id, scene, place)

    def world(self, episode: int, friction: float) -> None:
        """Tell what an episode's world is made of."""
        self._send(
            "world_parameters", "WorldParameters",
            episode_id=episode, world="randomised", shapes=["disk"] * self.parts.disks,
            friction=friction, rim_friction=2 * friction, tool_friction=3 * friction,
        )  # fmt: skip

    def push(self, episode: int, push_id: int, before: Scene, place: int) -> Scene:
        """Write a push and all that follows from it; return the scene after it."""
        parts, start = self.parts, self.scene_message(episode, before)
        push = self.push_message(push_id, episode)
        self._send("push", push)
        after = before.copy()
        after[0, :2] += self.random.uniform(0.01, 0.05, 2)
        after[1:2, 0] += 0.0 if place in parts.still else 0.03
        self.show(episode, before + 0.001, settled=False)
        self.scene_id += 1
        self.stamp += 1.25
        settled = place not in parts.unsettled
        end = self.scene_message(episode, after, settled)
        if parts.results and place not in parts.unanswered:
            self.result(push, start, end, prediction=self.prediction(place, after))
        self.show(episode, after, settled)
        self.show(episode, after, settled)  # the simulator says it again while it idles
        return after

    def prediction(self, place: int, after: Scene) -> dict[str, Any]:
        """Return what is said of a push before it ends; nothing where nobody predicted it."""
        if not self.parts.predictions or place in self.parts.unpredicted:
            return {}
        code = BLOCKED if place in self.parts.failed_prediction else OK
        disks = self.messages.disks(after + 0.002)
        return {"model": "bullet_nominal", "error_code": code, "disks": disks}

    def push_message(self, push_id: int, episode: int) -> Any:
        return self.messages.make(
            "sain_interfaces/msg/Push",
            push_id=push_id, episode_id=episode, scene_id=self.scene_id,
            location=self.random.uniform(-3, 3), angle=self.random.uniform(-0.7, 0.7), length=0.1,
        )  # fmt: skip

    def result(
        self, push: Any, before: Any, after: Any, code: int = OK, prediction: Any = ()
    ) -> None:
        """Write what became of a push."""
        predicted = self.messages.make("sain_interfaces/msg/Prediction", **dict(prediction))
        self._send(
            "push_result", "PushResult",
            push_id=push.push_id, episode_id=push.episode_id, error_code=code, push=push,
            error_message="" if code == OK else "a disk is in the way",
            before=before, after=after, duration=1.25, prediction=predicted,
        )  # fmt: skip

    def show(self, episode: int, scene: Scene, settled: bool = True) -> None:
        """Write a scene, unless scenes are not recorded."""
        if self.parts.scenes:
            self._send("scene", self.scene_message(episode, scene, settled))

    def scene_message(self, episode: int, scene: Scene, settled: bool = True) -> Any:
        make, seconds = self.messages.make, int(self.stamp)
        nanoseconds = round((self.stamp - seconds) * 1e9)
        stamp = make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return make(
            "sain_interfaces/msg/Scene",
            header=make("std_msgs/msg/Header", stamp=stamp, frame_id="world"),
            episode_id=episode, scene_id=self.scene_id, settled=settled,
            disks=self.messages.disks(scene),
        )  # fmt: skip

    def random_scene(self) -> Scene:
        count = self.parts.disks
        positions = np.stack([0.3 + 0.16 * np.arange(count), self.random.uniform(-0.1, 0.1, count)])
        radii = self.random.uniform(0.06, 0.075, count)
        return make_scene(positions.T, self.random.uniform(7, 9, count), radii)

    def _send(self, topic: str, message: Any, **fields: Any) -> None:
        if isinstance(message, str):
            message = self.messages.make(f"sain_interfaces/msg/{message}", **fields)
        kind = type(message).__name__.rpartition("__")[2]
        values = {name: getattr(message, name) for name in message.__dataclass_fields__}
        values.pop("__msgtype__", None)
        self.recording.add(f"{self.parts.namespace}/{topic}", kind, **values)
