"""Where an arm can push: a table for the planner, found by its own inverse kinematics."""

from collections import deque
from typing import Final

import numpy as np

from sain_arm.planning.push_planner import PushPlanner
from sain_arm.robot.robot import Vector
from sain_core.errors import SainError, UnreachableError
from sain_core.feasibility import Reach, ReachTable
from sain_core.push import DEFAULT_SPEED

CELLS: Final = 40  # along the shorter side of the workspace
FINEST: Final = 0.01  # [m], side of a cell; the coarsest is 2.5 times as large
FEW: Final = 20  # cells, where a minute is too long
POINTS: Final = 5  # of the lowering
SINGULAR: Final = 0.02  # of the largest singular value
SIDES: Final = ((1, 0), (-1, 0), (0, 1), (0, -1))


def reach_of(planner: PushPlanner, cells: int = CELLS) -> Reach:
    """Return where a robot states that its tool can stand, or else the table of its reach."""
    return planner.robot.reach or table_of_reach(planner, cells)


def table_of_reach(planner: PushPlanner, cells: int = CELLS) -> ReachTable:
    """Return the squares in which the tool can stand, lowered and raised, in the branch of home.

    There are about so many along the shorter side of the workspace.

    At each corner the arm keeps its limits, touches nothing, and could move the tool at the default
    speed of a push in any direction.

    Raises:
        UnreachableError: the arm cannot stand at any corner.
    """
    robot = planner.robot
    (left, right), (bottom, top) = robot.workspace[:2]
    finest = FINEST * CELLS / cells
    cell = float(np.clip(min(right - left, top - bottom) / cells, finest, 2.5 * finest))
    counts = np.array([int((right - left) / cell), int((top - bottom) / cell)]) + 1
    corner = np.array([left, bottom])
    stands = np.zeros(counts, dtype=bool)
    home = planner.arm.tip(robot.home)
    first = tuple(np.clip(np.round((home[:2] - corner) / cell), 0, counts - 1).astype(int).tolist())
    seen, queue = {first}, deque([(first, robot.home)])
    while queue:
        node, near = queue.popleft()
        joints = _joints_at(planner, corner + cell * np.array(node), near)
        if joints is None:
            continue
        stands[node] = True
        for step in SIDES:
            other = (node[0] + step[0], node[1] + step[1])
            inside = 0 <= other[0] < counts[0] and 0 <= other[1] < counts[1]
            if inside and other not in seen:
                seen.add(other)
                queue.append((other, joints))
    free = stands[1:, 1:] & stands[:-1, 1:] & stands[1:, :-1] & stands[:-1, :-1]
    if not free.any():
        raise UnreachableError(
            f"robot {robot.name!r} can push nowhere in its workspace: from home the tool's tip does"
            f" not get to ({corner[0] + cell * first[0]:.2f}, {corner[1] + cell * first[1]:.2f}) m;"
            " check base, tool, home and workspace in its file"
        )
    return ReachTable.of((float(left), float(bottom)), cell, free.T)


def _joints_at(planner: PushPlanner, place: np.ndarray, near: Vector) -> Vector | None:
    """Return joints with the tool raised at a place (2,), or None: it cannot push there."""
    arm, config = planner.arm, planner.config
    heights = np.linspace(config.raised, config.tip_height, POINTS)
    try:
        ways = planner.kinematics.follow(near, np.array([[*place, height] for height in heights]))
    except SainError:
        return None
    if arm.contacts(ways[0]) or arm.contacts(ways[-1]):
        return None
    arm.set_joints(ways[-1])
    # An arm of five joints cannot tilt the tool sideways: what is nearly singular does not count.
    rates = np.linalg.pinv(arm.jacobian()[:5], rcond=SINGULAR)[:, :2] * DEFAULT_SPEED
    if (np.linalg.norm(rates, axis=1) > arm.robot.velocity).any():
        return None
    return np.asarray(ways[0])
