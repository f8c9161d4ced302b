"""How many scenes the robot of ``examples/my_robot`` solves: the whole graph, no simulator.

    python -m benchmarks.own_robot [--scenes 50]

Each scene: somebody sets two disks up as in the scenario ``anywhere``, and a goal is given. The
robot's own truth judges whether the target is within 2 cm of it when the planner stops.
"""

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import rclpy
import tyro
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.node import Node

from sain_bringup.graph import executable
from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, ros_context
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.scene import POSE, POSITION, TARGET, unit
from sain_core.seeding import generator
from sain_core.shapes.bodies import check_bodies
from sain_core.types import Points, Scene
from sain_eval.loop.results import wilson_interval
from sain_eval.scenes.placement import draw_goal, touching_distance
from sain_interfaces.msg import Goal as GoalMessage
from sain_interfaces.msg import Plan
from sain_interfaces.msg import Scene as SceneMessage
from sain_sim.camera.body_file import BodyFile, read_bodies

EXAMPLE: Final = Path(__file__).parents[1] / "examples" / "my_robot"
BODIES: Final = EXAMPLE / "my_robot" / "bodies.yaml"
WAY: Final = (0.15, 0.30)  # [m], from target to goal
TOLERANCE: Final = 0.02  # [m]
MOST_PUSHES: Final = 15
PATIENCE: Final = 120.0  # [s], for one scene
NOISE: Final = "0.0005,0.005"


@dataclass(frozen=True)
class Options:
    """What is measured."""

    scenes: int = 50
    """scenes to solve"""
    seed: int = 0
    """of the first scene"""
    model: str = "planar"
    """what the planner plans with"""
    pace: float = 1.5
    """how many times as fast as asked the tool moves"""


class Person(Node):
    """Sets bodies up, gives goals, and looks where bodies really are."""

    def __init__(self) -> None:
        """Join the graph."""
        super().__init__("person", namespace=NAMESPACE)
        self.setting = self.create_publisher(PoseArray, "set_up", RELIABLE)
        self.aiming = self.create_publisher(GoalMessage, "goal", LATCHED)
        self.scene: SceneMessage | None = None
        self.plans: list[Plan] = []
        self.truth: PoseArray | None = None
        self.create_subscription(SceneMessage, "scene", self._on_scene, RELIABLE)
        self.create_subscription(Plan, "plan", self.plans.append, RELIABLE)
        self.create_subscription(PoseArray, "true_poses", self._on_truth, RELIABLE)

    def _on_scene(self, message: SceneMessage) -> None:
        self.scene = message

    def _on_truth(self, message: PoseArray) -> None:
        self.truth = message

    def wait(self, done: Callable[[], Any], what: str) -> None:
        """Wait until something is so."""
        end = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                raise TimeoutError(f"waited {PATIENCE:g} s for {what}")
            rclpy.spin_once(self, timeout_sec=0.05)

    def play(self, number: int, scene: Scene, goal: Points) -> tuple[float, int, bool]:
        """Return the true distance [m] at the end, the pushes, and whether the planner is done."""
        self.wait(lambda: self._settled((0, 0)), "a settled scene")
        assert self.scene is not None
        before = self.scene.episode_id, self.scene.scene_id
        self.wait(lambda: self.setting.get_subscription_count() > 0, "the robot")
        self.setting.publish(encode(scene))
        self.wait(lambda: self._settled(before), "the next scene")
        stamp = self.get_clock().now().to_msg()
        fields = {"episode_id": self.scene.episode_id, "max_pushes": MOST_PUSHES}
        message = codec.encode_goal(
            Goal.place(goal[0], goal[1], TOLERANCE), stamp=stamp, goal_id=number + 1, **fields
        )
        self.aiming.publish(message)
        self.wait(lambda: self._ended(number + 1), f"the end of scene {number}")
        (end,) = self._ended(number + 1)
        pushes = sum(plan.goal_id == number + 1 for plan in self.plans) - 1
        assert self.truth is not None
        place = self.truth.poses[TARGET].position
        distance = float(np.hypot(place.x - goal[0], place.y - goal[1]))
        return distance, pushes, end.status == Plan.REACHED

    def _settled(self, before: tuple[int, int]) -> bool:
        """Tell whether a later scene than these ids is settled."""
        scene = self.scene
        return scene is not None and scene.settled and (scene.episode_id, scene.scene_id) > before

    def _ended(self, goal_id: int) -> list[Plan]:
        return [p for p in self.plans if p.goal_id == goal_id and p.status != Plan.PUSH]


def draw(file: BodyFile, seed: int) -> tuple[Scene, Points]:
    """Draw a scene and a goal as the scenario ``anywhere`` does, with the robot's bodies."""
    random, feasibility = generator(seed, "own robot"), Feasibility()
    scene = file.scene(np.zeros((2, 3)))
    while True:
        scene[:, POSITION] = np.array([0.45, 0.0]) + random.uniform(-0.03, 0.03, 2)
        bearing = np.asarray(random.uniform(-np.pi, np.pi))
        scene[TARGET, POSITION] += (touching_distance(scene) + 0.001) * unit(bearing)
        goal = draw_goal(scene, WAY, feasibility, random)
        if goal is not None and feasibility.table.contains(scene[:, POSITION]).all():
            return check_bodies(scene), goal


def encode(scene: Scene) -> PoseArray:
    """Return the poses of a scene (N, 8) as a message."""
    message = PoseArray()
    for x, y, theta in scene[:, POSE].tolist():
        turn = Quaternion(z=float(np.sin(theta / 2)), w=float(np.cos(theta / 2)))
        message.poses.append(Pose(position=Point(x=x, y=y), orientation=turn))
    return message


@contextmanager
def graph(options: Options) -> Iterator[None]:
    """Run the graph with the robot as its users do."""
    paths = [str(EXAMPLE), os.environ.get("PYTHONPATH", "")]
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    robot = [sys.executable, "-c", RUN, str(options.pace)]
    command = [str(executable("sain_bringup", "graph")), "--robot", shlex.join(robot)]
    command += ["--bodies", str(BODIES), "--noise", NOISE, "--model", options.model, "--no-record"]
    with subprocess.Popen(command, env=variables, stdout=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)


RUN: Final = """
import sys
sys.argv[1:] = [*sys.argv[2:], "-p", f"pace:={sys.argv[1]}"]
from my_robot.robot_node import main
main()
"""


def main(options: Options = Options()) -> None:
    """Play the scenes and print how many were solved."""
    file, reached, counts = read_bodies(BODIES), 0, []
    with graph(options), ros_context():
        person = Person()
        for number in range(options.scenes):
            scene, goal = draw(file, options.seed + number)
            distance, pushes, done = person.play(number, scene, goal)
            reached += distance <= TOLERANCE
            counts.append(pushes)
            if distance > TOLERANCE or not done:
                print(f"scene {number}: {1e3 * distance:.1f} mm, {pushes} pushes, done: {done}")
        person.destroy_node()
    sure = wilson_interval(reached, options.scenes)
    print(
        f"{reached} of {options.scenes} scenes to {1e3 * TOLERANCE:g} mm with {options.model}"
        f" ({sure.low:.0%} to {sure.high:.0%}), {np.mean(counts):.1f} pushes"
    )


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
