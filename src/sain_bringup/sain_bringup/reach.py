"""How much of the table a robot reaches, and whether a scenario lies within."""

from collections.abc import Iterable

import numpy as np

from sain_arm.robot.robot import read_robot
from sain_core.errors import ConfigError
from sain_core.feasibility import ReachTable
from sain_core.scene import POSITION, Table
from sain_eval.scenes.families import ScenarioScene


def robot_reach(robot: str) -> ReachTable:
    """Return where a robot of this file or name can push; takes about a second.

    Raises:
        UnreachableError: nowhere.
    """
    from sain_arm.planning.push_planner import PushPlanner
    from sain_arm.planning.reach import FEW, table_of_reach

    return table_of_reach(PushPlanner(read_robot(robot)), FEW)


def describe_reach(robot: str, reach: ReachTable, table: Table = Table()) -> str:
    """Return in words how much of the table a robot reaches."""
    xs, ys = (
        np.linspace(low, high, 100)
        for low, high in ((table.x_min, table.x_max), (table.y_min, table.y_max))
    )
    share = reach.contains(np.stack(np.meshgrid(xs, ys), axis=-1)).mean()
    return f"robot {robot!r} reaches {share:.0%} of the table, {reach.describe()}"


def check_reach(robot: str, reach: ReachTable, cases: Iterable[ScenarioScene]) -> None:
    """Check that what is pushed in scenes, and its goals, are where a robot reaches.

    Raises:
        ConfigError: naming the body, and the share of the table that the robot reaches.
    """
    for case in cases:
        for body in case.bodies.pushable:
            _check_place(robot, reach, case, f"body {body}", case.disks[body, POSITION])
        for pose in (pose for goal in case.goals for pose in goal.poses):
            if pose.body in case.bodies.pushable:
                place = np.array([pose.x, pose.y])
                _check_place(robot, reach, case, f"a goal of body {pose.body}", place)


def _check_place(
    robot: str, reach: ReachTable, case: ScenarioScene, what: str, place: np.ndarray
) -> None:
    if not reach.contains(place):
        x, y = place
        raise ConfigError(
            f"{describe_reach(robot, reach)}: {what} is at ({x:.2f}, {y:.2f}) m in {case.scenario},"
            f" seed {case.seed}; choose another --scenario, --seed or --robot"
        )
