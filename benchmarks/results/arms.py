"""Simulated robot arms: 20 T-shaped bodies each, to poses within the arm's reach.

    ./env python -m benchmarks.results.arms [--robots ur5 so101] [--engine bullet] [--episodes 20]

Poses are given. The planner takes nominal masses, and infers friction from pushes. What breaks a
limit and what touches what is counted from the simulated joints. Writes results/arms.json.
"""

import json
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_planner import PushPlanner
from sain_arm.robot.robot import Robot
from sain_core.config import Config, option
from sain_core.errors import ConfigError, SainError
from sain_core.goal import BodyPose, Goal
from sain_core.output import OVERWRITE_HELP, claim_file, write_json
from sain_core.randomness import generator
from sain_core.scene import MASS, unit
from sain_core.shapes.body_file import BodyFile, parse_bodies
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.play import play
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import AgentConfig
from sain_sim.bench.bench import parameters_of
from sain_sim.bench.report import RATE, Report
from sain_sim.world.engines import ENGINES, MUJOCO
from sain_sim.world.truth import TruthConfig, hidden_world
from sain_sim.world.workcell import Sample, WorldConfig, steps_of
from sain_sim.world.world import World

SIZES = {"so101": 0.035}  # [m], radius of the T
SIZE = 0.09
ROOM = 0.025  # [m], for the tool around a body
LEAST_WAY = 0.1  # [m], from start to goal
MOST_PUSHES = 40
MOST_DRAWS = 10_000


@dataclass(frozen=True)
class ArmsOptions(Config):
    """Let robots push T-shaped bodies to poses."""

    robots: tuple[str, ...] = option(
        ("paper_panda", "panda", "so101", "ur5", "xarm7"), "names or files"
    )
    engine: str = option(MUJOCO, "of the physics", choices=tuple(ENGINES))
    episodes: int = option(20, "of each robot", minimum=1)
    model: str = option("planar", "what the planner predicts with")
    tolerance: float = option(0.01, "of a goal", unit="m", minimum=0.001)
    turn: float = option(0.05, "of a goal's heading", unit="rad", minimum=0.01)
    out: Path = option(Path("results/arms.json"), "file of the results")
    overwrite: bool = option(False, OVERWRITE_HELP)


def main(options: ArmsOptions) -> None:
    """Play all episodes; write the file after each robot. Others stay in it."""
    claim_file(options.out, options.overwrite)
    found: dict[str, Any] = json.loads(options.out.read_text()) if options.out.exists() else {}
    for name in options.robots:
        row = found[f"{name} {options.engine}"] = play_robot(name, options)
        write_json(options.out, found)
        summary = {key: value for key, value in row.items() if key != "episodes"}
        print(name, json.dumps(summary), flush=True)


def play_robot(name: str, options: ArmsOptions) -> dict[str, Any]:
    """Return what one robot achieved."""
    size = SIZES.get(name, SIZE)
    bodies = parse_bodies({"bodies": [{"shape": "t:flat", "radius": size, "role": "pushable"}]})
    cell = arm_cell(name)
    episodes = [play_episode(cell, bodies, seed, options) for seed in range(options.episodes)]
    return summary_of(episodes) | {"episodes": episodes}


def arm_cell(robot: str, aside: bool = False) -> WorldConfig:
    """Return a cell with what a robot can push; after a push the arm may wait aside."""
    cell = WorldConfig(robot, MotionConfig(), wait_aside=aside, full_motion=True)
    return cell.fitted(PushPlanner(cell.arm, config=cell.motion))


class ArmWorld:
    """A robot and bodies of a file, with masses as in the file; counts what pushes break."""

    def __init__(self, bodies: BodyFile, cell: WorldConfig, seed: int, engine: str) -> None:
        """Draw what is hidden from a seed."""
        truth = TruthConfig(hidden_world(engine), lab=seed, engine=engine)
        self.cell = World(parameters_of(bodies, truth, seed), cell, engine)
        self._masses, self._pushes, self._refused = bodies.masses, 0, list[str]()
        self.report = Report(self.cell.robot, bodies.bodies, bodies.radii)
        self._began, self._wall = self.cell.time, time.monotonic()

    def reset(self, start: Scene) -> Scene:
        """Put the bodies where a scene (N, 8) has them."""
        self.cell.place(start)
        return self.observe()

    def observe(self) -> Scene:
        """Return the bodies (N, 8)."""
        return self._seen(self.cell.observe())

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Push, and look at the arm all the way; raises as `World.push`."""
        try:
            outcome = self.cell.push(push, self._look, steps_of(1.0 / RATE), seen)
        except SainError as error:
            self._refused.append(f"{type(error).__name__}: {error}")
            raise
        self._pushes += 1
        self._seen(outcome.before), self._seen(outcome.after)
        return outcome

    def counts(self) -> dict[str, Any]:
        """Return all that was counted."""
        times = {
            "time": round(self.cell.time - self._began, 2),
            "wall": round(time.monotonic() - self._wall, 1),
        }
        report = {"limits": dict(self.report.limits), "contacts": dict(self.report.contacts)}
        return {"pushes": self._pushes, "refused": self._refused} | report | times

    def _look(self, sample: Sample) -> None:
        self.report.look(sample.joint_positions, sample.joint_velocities, sample.scene)

    def _seen(self, scene: Scene) -> Scene:
        scene[:, MASS] = self._masses
        return scene


def play_episode(
    cell: WorldConfig, bodies: BodyFile, seed: int, options: ArmsOptions
) -> dict[str, Any]:
    """Return what came of one episode."""
    config = AgentConfig(feasibility=cell.feasibility)
    world = ArmWorld(bodies, cell, seed, options.engine)
    start, pose = draw_task(cell.arm, bodies, config, seed, options.tolerance, options.turn)
    world.reset(bodies.scene(start[None]))
    agent = agent_maker(options.model, config)(SCENARIOS["push_t"].scene(seed))
    played = play(agent, world, [Goal((pose,))], bodies.bodies, MOST_PUSHES)
    episode = {"seed": seed, "solved": not played.failure, "failure": played.failure}
    episode |= world.counts()
    world.cell.close()
    print(cell.robot, json.dumps(episode), flush=True)
    return episode


def draw_task(
    robot: Robot, bodies: BodyFile, config: AgentConfig, seed: int, tolerance: float, turn: float
) -> tuple[np.ndarray, BodyPose]:
    """Return a pose (3,) to start from, and one as a goal."""
    random = generator(seed, "arms", robot.name)
    start, goal = draw_pose(random, bodies, config), draw_pose(random, bodies, config)
    while np.hypot(*(goal - start)[:2]) < min(LEAST_WAY, 2 * bodies.radii[0]):
        goal = draw_pose(random, bodies, config)
    x, y, heading = goal.tolist()
    return start, BodyPose(0, x, y, heading, tolerance, turn)


def draw_pose(random: np.random.Generator, bodies: BodyFile, config: AgentConfig) -> np.ndarray:
    """Return a pose (3,) with room for the tool all around."""
    reach, table = config.feasibility.reach, config.feasibility.table
    low, high = np.array([table.x_min, table.y_min]), np.array([table.x_max, table.y_max])
    room = bodies.radii[0] + ROOM
    for _ in range(MOST_DRAWS):
        place = random.uniform(low + room, high - room)
        around = room * unit(np.linspace(-np.pi, np.pi, 16))
        if reach.contains(place + around).all():
            return np.array([*place, random.uniform(-np.pi, np.pi)])
    raise ConfigError(f"no place in the arm's reach has room for a body of {room:.3f} m")


def summary_of(episodes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of one robot."""
    refused = Counter[str]()
    for episode in episodes:
        refused.update(text.split(":")[0] for text in episode["refused"])
    pushes = sum(episode["pushes"] for episode in episodes)
    times = [episode["time"] for episode in episodes if episode["solved"]]
    return {
        "solved": sum(episode["solved"] for episode in episodes),
        "of": len(episodes),
        "pushes": pushes,
        "refused": dict(refused),
        "refused_share": round(sum(refused.values()) / max(pushes + sum(refused.values()), 1), 4),
        "broken_limits": sum(sum(episode["limits"].values()) for episode in episodes),
        "other_contacts": sum(sum(episode["contacts"].values()) for episode in episodes),
        "median_time": round(float(np.median(times)), 1) if times else None,
    }


if __name__ == "__main__":
    main(tyro.cli(ArmsOptions))
