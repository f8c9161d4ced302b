"""Simulated robot arms: bodies to goals within the arm's reach.

    ./env python -m benchmarks.results.arms [--robots ur5 so101] [--engine bullet] [--episodes 20]
    ./env python -m benchmarks.results.arms --robots ur5 --see tags --task anywhere --model sain

The planner takes nominal masses, and infers friction from pushes. Where bodies are seen in images,
the arm waits aside after each push. Goals are judged by the simulation, and what breaks a limit or
touches what must not is counted from the simulated joints. Writes results/arms.json.
"""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tyro

from benchmarks.results.arm_world import ArmWorld, ImageSight
from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_planner import PushPlanner
from sain_arm.robot.robot import SHIPPED, Robot
from sain_bringup.graph import SEEN_NOISE, TAGS
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.goal import BodyPose, Goal
from sain_core.output import OVERWRITE_HELP, claim_file, write_json
from sain_core.randomness import generator
from sain_core.scene import POSE, POSITION, RADIUS, TARGET, unit, wrap_angle
from sain_core.shapes.body_file import BodyFile, parse_bodies, read_bodies
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.play import play
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.uncertainty import EstimatorConfig
from sain_sim.world.engines import ENGINES, MUJOCO
from sain_sim.world.workcell import WorldConfig

ANYWHERE, PUSH_T = "anywhere", "push_t"
POSES = "poses"
ROOM = 0.025  # [m], for the tool around a body
LEAST_WAY = 0.1  # [m], from start to goal
MOST_PUSHES = 40
MOST_DRAWS = 10_000


@dataclass(frozen=True)
class ArmsOptions(Config):
    """Let robots push bodies to goals."""

    robots: tuple[str, ...] = option(
        ("paper_panda", "panda", "so101", "ur5", "xarm7"), "names or files"
    )
    engine: str = option(MUJOCO, "of the physics", choices=tuple(ENGINES))
    see: str = option(POSES, "how bodies are seen", choices=(POSES, *SEEN_NOISE))
    task: str = option(PUSH_T, "what is pushed where", choices=(PUSH_T, ANYWHERE))
    episodes: int = option(20, "of each robot", minimum=1)
    model: str = option("planar", "what the planner predicts with")
    tolerance: float = option(0.01, "of a goal", unit="m", minimum=0.001)
    turn: float = option(0.05, "of the heading of a T's goal", unit="rad", minimum=0.01)
    out: Path = option(Path("results/arms.json"), "file of the results")
    overwrite: bool = option(False, OVERWRITE_HELP)


def main(options: ArmsOptions) -> None:
    """Play all episodes; write the file after each."""
    cv2.setNumThreads(1)
    claim_file(options.out, options.overwrite)
    found: dict[str, Any] = {"settings": repr(options)}
    seen = options.see != POSES
    noise = EstimatorConfig(noise=SEEN_NOISE[options.see], unknown="mass") if seen else None
    for name in options.robots:
        cell = WorldConfig(name, MotionConfig(), wait_aside=seen, full_motion=True)
        cell = cell.fitted(PushPlanner(cell.arm, config=cell.motion))
        config = AgentConfig(feasibility=cell.feasibility, estimator=noise or EstimatorConfig())
        rows: list[dict[str, Any]] = []
        for seed, bodies, poses, goal in cases(options, cell.arm, config):
            rows.append(play_episode(cell, bodies, poses, goal, config, seed, options))
            print(name, json.dumps(rows[-1]), flush=True)
            found[name] = summary_of(rows) | {"episodes": rows}
            write_json(options.out, found)
        print(name, json.dumps(summary_of(rows)), flush=True)


def cases(
    options: ArmsOptions, robot: Robot, config: AgentConfig
) -> Iterator[tuple[int, BodyFile, np.ndarray, BodyPose]]:
    """Yield seeds, bodies, their poses (N, 3) and goals, all within the arm's reach."""
    own = SHIPPED / "bodies" / f"{robot.name}.yaml"
    bodies = read_bodies(own if own.exists() else SHIPPED / "bodies" / "t.yaml")
    for seed in range(options.episodes) if options.task == PUSH_T else ():
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
    options: ArmsOptions,
) -> dict[str, Any]:
    """Return what came of one episode."""
    world = ArmWorld(bodies, cell, seed, options.engine)
    world.reset(bodies.scene(poses))
    seen = options.see != POSES
    sight = ImageSight(world, bodies, options.see, seed) if seen else world
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
    times = [episode["time"] for episode in episodes if episode["solved"]]
    return {
        "solved": sum(episode["solved"] for episode in episodes),
        "of": len(episodes),
        "pushes": sum(episode["pushes"] for episode in episodes),
        "refused": dict(refused),
        "broken_limits": sum(sum(episode["limits"].values()) for episode in episodes),
        "other_contacts": sum(sum(episode["contacts"].values()) for episode in episodes),
        "median_time": round(float(np.median(times)), 1) if times else None,
    }


if __name__ == "__main__":
    main(tyro.cli(ArmsOptions, description=__doc__))
