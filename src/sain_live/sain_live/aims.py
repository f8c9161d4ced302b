"""Goals as the page handles them: poses that can be dragged, checked before they are sent."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION, TARGET, THETA, Table
from sain_core.shapes.bodies import Bodies, Role, overlap
from sain_core.types import Scene
from sain_mppi.search.goal import Goal, check_goal, check_in_reach
from sain_mppi.search.poses import MOST_SHARED, TOLERANCE, BodyPose, PoseGoal, goal_among

FIRST_WAY: Final = (0.12, 0.0)  # [m], from a body to the goal that it is given first
FEASIBILITY: Final = Feasibility()


@dataclass(frozen=True, eq=False)
class Aim:
    """Where bodies should come to rest.

    Attributes:
        goal: a place (2,) [m] for the target, or poses of bodies.
        tolerance: [m], of the place.
    """

    goal: Goal | PoseGoal
    tolerance: float = TOLERANCE

    @property
    def poses(self) -> tuple[BodyPose, ...]:
        """What can be dragged, one for each body of the goal."""
        if isinstance(self.goal, PoseGoal):
            return self.goal.poses
        x, y = self.goal.tolist()
        return (BodyPose(TARGET, x, y, tolerance=self.tolerance),)

    def moved(self, body: int, x: float, y: float, heading: float) -> "Aim":
        """Return the goal with the pose of one body replaced; a free heading stays free."""
        if not isinstance(self.goal, PoseGoal):
            return replace(self, goal=np.array([x, y]))
        poses = tuple(
            replace(pose, x=x, y=y, heading=None if pose.heading is None else heading)
            if pose.body == body
            else pose
            for pose in self.goal.poses
        )
        return replace(self, goal=replace(self.goal, poses=poses))

    def among(self, count: int) -> "Aim":
        """Return the goal in a scene of so many bodies."""
        return replace(self, goal=goal_among(self.goal, self.tolerance, count))

    def same(self, other: "Aim | None") -> bool:
        """Tell whether another goal asks for the same."""
        return other is not None and self.poses == other.poses

    def errors(self, scene: Scene, bodies: Bodies) -> tuple[float, float]:
        """Return the largest distance [m] and turn [rad] of a body from its pose."""
        apart, turns = PoseGoal(self.poses).errors(scene, bodies)
        return float(apart.max()), float(np.abs(turns).max())


def first_aim(scene: Scene, bodies: Bodies, table: Table = FEASIBILITY.table) -> Aim | None:
    """Return a goal to begin with, for a scene that has none: near the target, on the table."""
    disks = bodies.stand_in_for_disks and len(bodies) > TARGET
    movable = [body for body in range(len(bodies)) if bodies.roles[body] is not Role.FIXED]
    body = TARGET if TARGET in movable else movable[0]
    shape = bodies.shapes[body]
    for way in (1.0, -1.0, 0.5, -0.5, 0.0):
        for turned in (np.array(FIRST_WAY), np.array(FIRST_WAY[::-1])):
            place = scene[body, POSITION] + way * turned
            if not table.contains(place):
                continue
            x, y = place.tolist()
            if disks:
                aim = Aim(place)
            else:
                heading = None if shape.is_round else float(scene[body, THETA])
                aim = Aim(PoseGoal((BodyPose(body, x, y, heading),)))
            try:
                check_aim(aim, scene, bodies)
            except (InvalidInputError, ValueError):
                continue
            return aim
    return None


def check_aim(
    aim: Aim, scene: Scene, bodies: Bodies, feasibility: Feasibility = FEASIBILITY
) -> None:
    """Check that bodies can be brought to a goal, before it is sent.

    Bodies that the tool may push are no obstacle: the planner moves them away.

    Raises:
        OffTableError: off the table.
        UnreachableError: the arm cannot push a target there, from any side.
        InvalidInputError: into a body that stays where it is; all else that `PoseGoal` checks.
    """
    table = feasibility.table
    if isinstance(aim.goal, PoseGoal):
        aim.goal.check(scene, bodies, table)
    else:
        check_goal(aim.goal, table)
        if bodies.stand_in_for_disks and len(scene) > TARGET:
            check_in_reach(aim.goal, scene, feasibility)
    poses = PoseGoal(aim.poses)
    placed, aimed = poses.placed(scene), {pose.body for pose in aim.poses}
    for body in aimed:
        for other, role in enumerate(bodies.roles):
            if other in aimed or role is Role.PUSHABLE:
                continue
            deep = overlap(placed, bodies, body, other)
            if deep > MOST_SHARED:
                raise InvalidInputError(
                    f"the goal of body {body} lies in body {other}"
                    f" ({bodies.shapes[other].footprint}), by {1e3 * deep:.0f} mm;"
                    " drag it to a free place"
                )
