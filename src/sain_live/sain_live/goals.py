"""Goals as the page handles them: one to begin with, and the check before one is sent."""

from contextlib import suppress
from itertools import product
from typing import Final

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.feasibility import Feasibility
from sain_core.goal import MOST_SHARED, BodyPose, Goal
from sain_core.scene import POSITION, TARGET, THETA
from sain_core.shapes.bodies import Bodies, Role, overlap
from sain_core.types import Scene
from sain_mppi.objective.problem import Problem

FIRST_WAY: Final = (0.12, 0.0)  # [m], from a body to the goal that it is given first
FEASIBILITY: Final = Feasibility()


def first_goal(scene: Scene, bodies: Bodies) -> Goal | None:
    """Return a goal to begin with, for a scene that has none: near the target, on the table."""
    movable = [body for body in range(len(bodies)) if bodies.roles[body] is not Role.FIXED]
    body = TARGET if TARGET in movable else movable[0]
    shape = bodies.shapes[body]
    heading = None if shape.is_round else float(scene[body, THETA])
    for far, way in product((1.0, -1.0, 0.5, -0.5, 0.0), (FIRST_WAY, FIRST_WAY[::-1])):
        place = scene[body, POSITION] + far * np.array(way)
        if FEASIBILITY.table.contains(place):
            x, y = place.tolist()
            goal = Goal((BodyPose(body, x, y, heading),))
            with suppress(ValueError):  # another place may be free
                check_goal(goal, scene, bodies)
                return goal
    return None


def check_goal(goal: Goal, scene: Scene, bodies: Bodies) -> None:
    """Check that bodies can be brought to a goal, before it is sent.

    Bodies that the tool may push are no obstacle: the planner moves them away.

    Raises:
        OffTableError: off the table.
        UnreachableError: the arm cannot push a target there, from any side.
        InvalidInputError: into a body that stays where it is; all else that `Goal` checks.
    """
    Problem(scene, goal, bodies, scene, FEASIBILITY).check_goal()
    placed = goal.placed(scene)
    for body in goal.wanted:
        for other, role in enumerate(bodies.roles):
            if other in goal.wanted or role is Role.PUSHABLE:
                continue
            deep = overlap(placed, bodies, body, other)
            if deep > MOST_SHARED:
                raise InvalidInputError(
                    f"the goal of body {body} lies in body {other}"
                    f" ({bodies.shapes[other].name}), by {1e3 * deep:.0f} mm;"
                    " drag it to a free place"
                )
