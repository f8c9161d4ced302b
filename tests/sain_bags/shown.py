"""A recording made to be looked at: disks that move, stamps, plans, a refused push."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from sain_core.push import make_push
from sain_core.scene import make_scene
from sain_core.types import Scene
from tests.sain_bags.driven import Drive, Parts

STEPS = 12  # scenes in motion during a push
PLANNED = make_push(0.1, 0.1, [0.1, 0.1])
PERIOD = 0.04  # [s] between two of them
OK, BLOCKED = 1, 9


class Show(Drive):
    """Writes episodes in which every disk moves in a straight line, push by push."""

    def __init__(self, recording: Any, scenes: bool = True, results: bool = True) -> None:
        super().__init__(recording, Parts(scenes=scenes))
        self.make, self.results, self.push_id = recording.messages.make, results, 0
        self.stamp = 5.0
        self.source, self.error = "/sain/mppi_node", "disk 2 is in the way"

    def episode(self, number: int, disks: int, ends: Sequence[float], refused: int = -1) -> None:
        """Write an episode; each push moves every disk by so much along x and half along y."""
        scene = self._first(disks)
        self.scene_id += 1
        place = scene[1, 0] + sum(ends), scene[1, 1] + sum(ends) / 2
        poses = self.recording.messages.poses(*place)
        self._send("goal", "Goal", goal_id=number, episode_id=number, poses=poses)
        self.show(number, scene, settled=True)
        for place, distance in enumerate(ends):
            if place == refused:
                self._push(number, scene, scene, code=BLOCKED)
            scene = self._push(number, scene, scene + _shift(scene, distance))

    def _push(self, episode: int, before: Scene, after: Scene, code: int = OK) -> Scene:
        self.push_id += 1
        ids = {"push_id": self.push_id, "episode_id": episode}
        push = self.make(
            "sain_interfaces/msg/Push", **ids, scene_id=self.scene_id,
            **action(self.push_id), source=self.source,
        )  # fmt: skip
        off = 0.001 * self.push_id
        expected = np.stack([after + _shift(after, off), after])
        self._send("push", push)
        self._send(
            "plan", "Plan", plan_id=self.push_id, **ids, status=1, error_code=1, dynamics="sain",
            horizon=2, disks=len(before), pushes=PLANNED.ravel(), predicted=expected.ravel(),
            planning_time=0.01 * self.push_id,
        )  # fmt: skip
        start = self.scene_message(episode, before, True)
        if code == OK:
            for share in np.linspace(0.0, 1.0, STEPS, endpoint=False):
                self.stamp += PERIOD
                self.show(episode, before + share * (after - before), settled=False)
            self.stamp += PERIOD
            self.scene_id += 1
        result = self.scene_message(episode, after, True)
        if self.results:
            disks = self.recording.messages.disks(after + _shift(after, 3 * off))
            prediction = {"model": "bullet_nominal", "error_code": code, "disks": disks}
            self._send(
                "push_result", "PushResult", **ids, error_code=code, push=push, before=start,
                after=result, error_message="" if code == OK else self.error,
                prediction=self.make("sain_interfaces/msg/Prediction", **prediction),
            )  # fmt: skip
        self.show(episode, after, settled=True)
        self.show(episode, after, settled=True)  # a simulator says it again while it idles
        return after

    def _first(self, disks: int) -> Scene:
        positions = np.array([[0.30 + 0.13 * disk, 0.02 * disk] for disk in range(disks)])
        return make_scene(positions, np.full(disks, 8.0), np.linspace(0.07, 0.05, disks))


def action(push_id: int) -> dict[str, float]:
    """Return a push that no other number has."""
    location = (0.7 * push_id + np.pi) % (2 * np.pi) - np.pi
    return {
        "location": location,
        "angle": 0.31 - 0.17 * push_id,
        "length": 0.0513 + 0.011 * push_id,
    }


def _shift(scene: Scene, distance: float) -> Scene:
    """Return what to add to every disk's state: along x, half of it along y, and a turn."""
    shift = np.zeros_like(scene)
    shift[:, :3] = distance * np.array([1.0, 0.5, 3.0])
    return shift


def recorded(folder: Path) -> dict[str, list[Any]]:
    """Read a bag with `rosbags`: its messages by the last part of their topic."""
    found: dict[str, list[Any]] = {}
    with AnyReader([folder]) as reader:
        for connection, _, raw in reader.messages():
            name = connection.topic.rpartition("/")[2]
            found.setdefault(name, []).append(reader.deserialize(raw, connection.msgtype))
    return found


def shown_scenes(folder: Path, episode: int) -> list[Any]:
    """Return the scenes of an episode, without those at rest that say the same again."""
    scenes, rests = [], set()
    for scene in recorded(folder)["scene"]:
        if scene.episode_id == episode and not (scene.settled and scene.scene_id in rests):
            scenes.append(scene)
            rests |= {scene.scene_id} if scene.settled else set()
    return scenes
