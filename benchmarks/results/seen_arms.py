"""A robot arm that sees by images alone: bodies are pushed to goals in simulation.

    ./env python -m benchmarks.results.seen_arms --see tags --task push_t [--episodes 100]

Images, detection, scenes, planning, the arm's way and MuJoCo are the parts that run in the graph;
there are no topics in between, no wall clock. After each push the arm waits aside. Goals are judged
by the simulation, not by what was seen. Episodes in the file are not played again.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tyro

from benchmarks.results.arms import (
    MOST_PUSHES,
    ROOM,
    ArmWorld,
    arm_cell,
    draw_task,
    summary_of,
)
from sain_arm.robot.robot import SHIPPED, Robot
from sain_bringup.graph import OUTLINES, SEEN_NOISE, TAGS
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.config import Config, option
from sain_core.errors import ErrorCode, SainError
from sain_core.goal import BodyPose, Goal
from sain_core.output import OVERWRITE_HELP, claim_file, write_json
from sain_core.randomness import generator
from sain_core.scene import POSE, POSITION, RADIUS, TARGET, wrap_angle
from sain_core.shapes.body_file import BodyFile, parse_bodies, read_bodies
from sain_core.types import PushArray, Scene
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.play import Sight, play
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.uncertainty import EstimatorConfig
from sain_sim.camera.renderer import image_camera
from sain_sim.world.engines import MUJOCO
from sain_sim.world.workcell import WorldConfig, steps_of
from sain_vision.detection.arm_mask import ArmMask
from sain_vision.detection.outlines import OutlineConfig, OutlineFinder
from sain_vision.detection.sighting import Sighting
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.optics import CameraModel
from sain_vision.scene.body_track import Observed, TrackingConfig
from sain_vision.scene.scene_tracker import SceneTracker

ANYWHERE = "anywhere"
PUSH_T = "push_t"
LATENCY = 0.06  # [s], from an image to the pose in it
PATIENCE = 12.0  # [s], then nothing is seen


@dataclass(frozen=True)
class SeenArmsOptions(Config):
    """Let a robot push bodies that it sees in images."""

    see: str = option(TAGS, "what is looked for in images", choices=tuple(SEEN_NOISE))
    task: str = option(PUSH_T, "what is pushed where", choices=(PUSH_T, ANYWHERE))
    robot: str = option("ur5", "name or file of the robot")
    episodes: int = option(100, "how many", minimum=1)
    model: str = option("sain", "what the planner predicts with")
    tolerance: float = option(0.01, "of a goal", unit="m", minimum=0.001)
    turn: float = option(0.05, "of the heading of a T's goal", unit="rad", minimum=0.01)
    out: Path = option(Path("results/seen_arms.json"), "file of the results")
    overwrite: bool = option(False, OVERWRITE_HELP)


class ImageSight(Sight):
    """Sees a world by its camera's images alone. Its time is that of the world."""

    world: ArmWorld

    def __init__(self, world: ArmWorld, bodies: BodyFile, see: str, seed: int) -> None:
        """Stand over the table."""
        super().__init__(world)
        config = ImageCameraConfig()
        if see == OUTLINES:
            config = replace(config, width=640, height=480, detail=1.0)
        self._camera = image_camera(
            config, world.cell.robot, bodies.bodies, bodies.radii, tags=bodies.tags
        )
        self._steps = steps_of(1.0 / config.rate)
        size, lens = (config.width, config.height), np.array(config.distortion)
        self._model = CameraModel(*size, config.matrix, lens, *config.stated_pose)
        self._random = generator(seed, "images")
        self._outlines = OutlineFinder(bodies, OutlineConfig()) if see == OUTLINES else None
        self._mask = ArmMask(world.cell.robot)
        self._tags = TagFinder(TagConfig()), TagLocator(bodies, TagConfig())
        self._last: dict[int, np.ndarray] = {}
        self._pushes = 0
        self.tracker = SceneTracker(bodies, TrackingConfig(noise=SEEN_NOISE[see]))

    @property
    def time(self) -> float:
        """Time of the world [s]."""
        return self.world.cell.time

    def look(self) -> Iterator[tuple[Scene, float]]:
        """Yield scenes at rest, one of each image; none comes if nothing rests."""
        while self._await_rest():
            yield self.tracker.scene(), self.tracker.stamp

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Push; return the scene that is seen next, at rest."""
        self._pushes += 1
        ids, tracker = (self.tracker.episode_id, self.tracker.scene_id), self.tracker
        tracker.sent(self._pushes, *ids, self.time)
        try:
            self.world.push(push, seen=seen)
        except SainError:
            tracker.answered(self._pushes, int(ErrorCode.BLOCKED), self.time)
            raise
        tracker.answered(self._pushes, int(ErrorCode.OK), self.time)
        self._await_rest()
        return tracker.scene()

    def _await_rest(self) -> bool:
        """Take images until bodies rest."""
        began = self.time
        while self.time < began + PATIENCE:
            self._take()
            if self.tracker.settled:
                return True
        return False

    def _take(self) -> None:
        world = self.world.cell
        joints, _ = world.joint_states()
        for _ in range(self._steps):
            world.step(joints, np.zeros_like(joints))
        stamp = self.time
        shot = self._camera.take(joints, world.observe(), self._random)
        seen = {
            one.body: Observed(one.pose, one.covariance)
            for one in self._found(shot.colour, shot.depth)
        }
        self.tracker.observe(seen, stamp, stamp + LATENCY)

    def _found(self, colour: np.ndarray, depth: np.ndarray) -> list[Sighting]:
        if self._outlines is None:
            finder, locator = self._tags
            grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY))
            return locator.locate(finder.find(grey), self._model)[0]
        metres = np.where(depth > 0, depth * 1e-3, np.nan)
        known = {body: [pose] for body, pose in self._last.items()}
        arm = self._mask.draw(self.world.cell.joint_states()[0], self._model)
        found = self._outlines.find(metres, self._model, known, arm=arm)[0]
        self._last |= {one.body: one.pose for one in found}
        return found


def main(options: SeenArmsOptions) -> None:
    """Play all episodes; write the file after each."""
    cv2.setNumThreads(1)
    claim_file(options.out, options.overwrite)
    found: dict[str, Any] = json.loads(options.out.read_text()) if options.out.exists() else {}
    name = f"{options.robot} {options.task} {options.see}"
    rows = found.setdefault(name, {"settings": repr(options), "episodes": []})["episodes"]
    cell = arm_cell(options.robot, aside=True)
    estimator = EstimatorConfig(noise=SEEN_NOISE[options.see], unknown="mass")
    config = AgentConfig(feasibility=cell.feasibility, estimator=estimator)
    for seed, bodies, poses, goal in cases(options, cell.arm, config):
        if seed in [row["seed"] for row in rows]:
            continue
        rows.append(play_episode(cell, bodies, poses, goal, config, seed, options))
        found[name]["summary"] = summary_of(rows)
        write_json(options.out, found)
        print(json.dumps(rows[-1]), flush=True)
    print(name, json.dumps(found[name]["summary"]), flush=True)


def cases(
    options: SeenArmsOptions, robot: Robot, config: AgentConfig
) -> Iterator[tuple[int, BodyFile, np.ndarray, BodyPose]]:
    """Yield seeds, bodies, their poses (N, 3) and goals, all within the arm's reach."""
    for seed in range(options.episodes) if options.task == PUSH_T else ():
        bodies = read_bodies(SHIPPED / "bodies" / "t.yaml")
        start, goal = draw_task(robot, bodies, config, seed, options.tolerance, options.turn)
        yield seed, bodies, start[None], goal
    count = seed = 0
    while options.task == ANYWHERE and count < options.episodes:
        case, seed = SCENARIOS[ANYWHERE].scene(seed), seed + 1
        (target,) = case.goals[0].poses
        places = np.concatenate([case.disks[:, POSITION], [[target.x, target.y]]])
        room = [*case.disks[:, RADIUS], case.disks[TARGET, RADIUS]]
        if (config.feasibility.reach.room(places) < np.array(room) + ROOM).any():
            continue
        count += 1
        rows = [
            {"shape": "disk:flat", "radius": float(row[RADIUS]), "role": str(role)}
            | ({"tags": body} if options.see == TAGS else {})
            for body, (row, role) in enumerate(
                zip(case.disks, case.parameters().bodies.roles, strict=True)
            )
        ]
        goal_pose = replace(target, tolerance=options.tolerance)
        yield case.seed, parse_bodies({"bodies": rows}), case.disks[:, POSE], goal_pose


def play_episode(
    cell: WorldConfig,
    bodies: BodyFile,
    poses: np.ndarray,
    goal: BodyPose,
    config: AgentConfig,
    seed: int,
    options: SeenArmsOptions,
) -> dict[str, Any]:
    """Return what came of one episode."""
    world = ArmWorld(bodies, cell, seed, MUJOCO)
    world.reset(bodies.scene(poses))
    sight = ImageSight(world, bodies, options.see, seed)
    agent = agent_maker(options.model, config)(SCENARIOS[options.task].scene(seed))
    played = play(agent, sight, [Goal((goal,))], bodies.bodies, MOST_PUSHES)
    pose = world.observe()[goal.body, POSE]
    off = float(np.hypot(pose[0] - goal.x, pose[1] - goal.y))
    turn = 0.0 if goal.heading is None else float(wrap_angle(np.asarray(pose[2] - goal.heading)))
    return {
        "seed": seed,
        "solved": not played.failure and off <= goal.tolerance and abs(turn) <= options.turn,
        "failure": played.failure,
        "off_mm": round(1e3 * off, 2),
        "turn": round(abs(turn), 4),
    } | world.counts()


if __name__ == "__main__":
    main(tyro.cli(SeenArmsOptions, description=__doc__))
