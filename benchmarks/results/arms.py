"""Four robot arms in the laboratory: 20 T-shaped bodies each, to poses within the arm's reach.

    ./env python -m benchmarks.results.arms [--robots ur5 so101] [--episodes 20]

Poses are given. The planner takes nominal masses, and infers friction from pushes. The laboratory
counts by itself what breaks a limit and what touches what. Writes results/arms.json.
"""

import json
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from sain_arm.laboratory.laboratory_config import LaboratoryConfig
from sain_arm.laboratory.world import LaboratoryWorld
from sain_arm.planning.push_planner import PushPlanner
from sain_arm.planning.reach import table_of_reach
from sain_arm.robot.robot import Robot, read_robot
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.output import OVERWRITE_HELP, claim_file, write_json
from sain_core.randomness import generator
from sain_core.scene import unit
from sain_core.shapes.body_file import BodyFile, parse_bodies
from sain_eval.loop.closed_loop import agent_maker, play_goals
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import AgentConfig

SIZES = {"so101": 0.035}  # [m], radius of the T
SIZE = 0.09
ROOM = 0.025  # [m], for the tool around a body
LEAST_WAY = 0.1  # [m], from start to goal
MOST_PUSHES = 40
MOST_DRAWS = 10_000


@dataclass(frozen=True)
class ArmsOptions(Config):
    """Let robots push T-shaped bodies to poses."""

    robots: tuple[str, ...] = option(("panda", "so101", "ur5", "xarm7"), "names or files")
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
        found[name] = play_robot(name, options)
        write_json(options.out, found)
        summary = {key: value for key, value in found[name].items() if key != "episodes"}
        print(name, json.dumps(summary), flush=True)


def play_robot(name: str, options: ArmsOptions) -> dict[str, Any]:
    """Return what one robot achieved."""
    robot, size = read_robot(name), SIZES.get(name, SIZE)
    bodies = parse_bodies({"bodies": [{"shape": "t:flat", "radius": size, "role": "pushable"}]})
    config = AgentConfig(feasibility=feasibility_of(robot))
    episodes = [
        play_episode(robot, bodies, config, seed, options) for seed in range(options.episodes)
    ]
    return summary_of(episodes) | {"episodes": episodes}


def feasibility_of(robot: Robot) -> Feasibility:
    """Return what a robot can push."""
    limits = replace(Feasibility().limits, tool_radius=robot.tool_radius)
    return Feasibility(limits=limits, reach=table_of_reach(PushPlanner(robot)))


def play_episode(
    robot: Robot, bodies: BodyFile, config: AgentConfig, seed: int, options: ArmsOptions
) -> dict[str, Any]:
    """Return what came of one episode."""
    start, pose = draw_task(robot, bodies, config, seed, options.tolerance, options.turn)
    world = LaboratoryWorld(robot, bodies, config.feasibility, LaboratoryConfig(seed=seed))
    world.reset(bodies.scene(start[None]))
    began, wall = world.cell.time, time.monotonic()
    agent = agent_maker(options.model, config)(SCENARIOS["push_t"].scene(seed))
    played = play_goals(agent, world, [Goal((pose,))], bodies.bodies, MOST_PUSHES)
    episode = {"seed": seed, "solved": not played.failure, "failure": played.failure}
    episode |= counts_of(world, began, wall)
    print(robot.name, json.dumps(episode), flush=True)
    return episode


def counts_of(world: LaboratoryWorld, began: float, wall: float) -> dict[str, Any]:
    """Return what a laboratory has counted since a time of its own and one of the wall [s]."""
    report = world.cell.report
    return {
        "pushes": world.pushes,
        "refused": list(world.refused),
        "limits": dict(report.limits),
        "contacts": dict(report.contacts),
        "time": round(world.cell.time - began, 2),
        "wall": round(time.monotonic() - wall, 1),
    }


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
