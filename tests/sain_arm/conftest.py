"""Robots with their planners, made once."""

from functools import cache

import numpy as np
import pytest

from sain_arm.planning.push_planner import PushPlanner
from sain_arm.planning.reach import table_of_reach
from sain_arm.robot.robot import Robot, read_robot, shipped
from sain_core.feasibility import ReachTable
from sain_core.shapes.bodies import Bodies

BODIES = Bodies.named(["t:flat", "disk:flat"])


class Planned:
    """A robot, its planner among a T and a disk, and where it reaches."""

    def __init__(self, name: str) -> None:
        self.robot: Robot = read_robot(name)
        self.radii = (0.035, 0.03) if name == "so101" else (0.09, 0.05)
        self.planner = PushPlanner(self.robot, BODIES, self.radii)
        self.reach: ReachTable = reach_of(name)

    def place(self, random: np.random.Generator, room: float) -> np.ndarray:
        """Draw a place (2,) so far inside of the reach."""
        low, high = self.robot.workspace[:2].T
        places = random.uniform(low, high, (5000, 2))
        inside = places[self.reach.room(places) >= room]
        assert len(inside), f"nothing is {room} m inside of the reach"
        return inside[0]


@cache
def reach_of(name: str) -> ReachTable:
    return table_of_reach(PushPlanner(read_robot(name)), 20)


@cache
def planned_robot(name: str) -> Planned:
    return Planned(name)


@pytest.fixture(params=shipped())
def planned(request):
    return planned_robot(request.param)


@pytest.fixture
def ur5():
    return planned_robot("ur5")
