"""How much of the table a robot reaches, and whether a scenario lies within."""

from collections.abc import Iterable
from functools import lru_cache
from typing import Final

import numpy as np

from sain_arm.robot.robot import read_robot
from sain_core.errors import ConfigError, OutOfRangeError
from sain_core.feasibility import Feasibility, Reach
from sain_core.scene import POSITION, Table, unit
from sain_core.types import Points
from sain_eval.scenes.families import ScenarioScene
from sain_mppi.agent.dead_end import OBLIQUE, Way
from sain_mppi.objective.problem import Problem

TABLE: Final = Table()
SIDES: Final = np.array([0.0, -0.5, 0.5, -1.0, 1.0])  # of the most oblique pushes
ASIDE: Final = 0.1  # of the distance from the middle line, that counts against a place
PLACES: Final = np.stack(  # (P, 2) [m], all over the table
    np.meshgrid(
        np.linspace(TABLE.x_min, TABLE.x_max, 101), np.linspace(TABLE.y_min, TABLE.y_max, 101)
    ),
    axis=-1,
).reshape(-1, 2)


@lru_cache(maxsize=1)
def robot_reach(robot: str) -> Reach:
    """Return where a robot of this file or name can push; takes about a second.

    Raises:
        UnreachableError: nowhere.
    """
    from sain_arm.planning.push_planner import PushPlanner
    from sain_arm.planning.reach import FEW, reach_of

    return reach_of(PushPlanner(read_robot(robot)), FEW)


def describe_reach(robot: str) -> str:
    """Return in words how much of the table a robot reaches."""
    reach = robot_reach(robot)
    share = reach.contains(PLACES).mean()
    return f"robot {robot!r} reaches {share:.0%} of the table, {reach.describe()}"


def fitting_place(robot: str, needed: float) -> Points:
    """Return a place (2,) [m] with most reach all around, near the middle line of the table.

    Raises:
        OutOfRangeError: nowhere as much as needed [m].
    """
    rooms = robot_reach(robot).room(PLACES)
    if (most := float(rooms.max())) < needed:
        raise OutOfRangeError(
            f"the tool of robot {robot!r} must stand {needed:.3f} m from the body's middle on all"
            f" sides; the largest circle in its reach has a radius of {most:.3f} m"
        )
    score = np.where(rooms < needed, -np.inf, rooms - ASIDE * abs(PLACES[:, 1]))
    return np.asarray(PLACES[np.argmax(score)])


def check_reach(robot: str, cases: Iterable[ScenarioScene]) -> None:
    """Check that what is pushed in scenes, and its goals, are where a robot reaches.

    A body that only another one may push needs the tool behind both, within 45 degrees.

    Raises:
        ConfigError: naming the body, and the share of the table that the robot reaches.
    """
    for case in cases:
        for body in case.bodies.pushable:
            _check_place(robot, case, f"body {body}", case.disks[body, POSITION])
        for goal in case.goals:
            for pose in goal.poses:
                if pose.body in case.bodies.pushable:
                    place = np.array([pose.x, pose.y])
                    _check_place(robot, case, f"a goal of body {pose.body}", place)
            reach = Feasibility(reach=robot_reach(robot))
            way = Way.of(Problem(case.disks, goal, case.bodies, case.disks, reach))
            if way.pusher != way.body:
                what = f"the tool that pushes body {way.body} by body {way.pusher}"
                back = way.stand - way.place
                sides = np.arctan2(back[1], back[0]) + OBLIQUE * SIDES
                stands = way.place + np.linalg.norm(back) * unit(sides)
                _check_place(robot, case, what, *stands)


def _check_place(robot: str, case: ScenarioScene, what: str, *places: Points) -> None:
    if not robot_reach(robot).contains(np.stack(places)).any():
        x, y = places[0]
        raise ConfigError(
            f"{describe_reach(robot)}: {what} is at ({x:.2f}, {y:.2f}) m in {case.scenario},"
            f" seed {case.seed}; choose another --scenario, --seed or --robot"
        )
