"""Whether the arm can bring bodies to a goal, from some side."""

from typing import Final

import numpy as np

from sain_core.errors import UnreachableError
from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.scene import RADIUS, unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outline import outline_of
from sain_core.types import Scene

SIDES: Final = 72  # from which a goal is looked at
SLIDE: Final = 0.03  # [m], how far bodies may slide on behind a tool that stops


def pusher_of(goal: Goal, body: int, bodies: Bodies) -> int:
    """Return what pushes a body of a goal: itself if the tool may touch it, or else another body.

    That is the first one that the tool may push, rather one without a pose of its own.
    """
    if body in bodies.pushable:
        return body
    free = [one for one in bodies.pushable if one not in (*goal.wanted, *goal.keep)]
    return (*free, *bodies.pushable, body)[0]


def check_in_reach(goal: Goal, scene: Scene, bodies: Bodies, feasibility: Feasibility) -> None:
    """Check that the arm can push the bodies of a scene (N, 8) to a goal, each from some side.

    The tool then stands behind the body, or behind another one that pushes it, but for as far as
    bodies slide on. A body that is there already needs no push.

    Raises:
        UnreachableError: from no side.
    """
    for pose, away in zip(goal.poses, goal.errors(scene, bodies)[0], strict=True):
        if away > pose.tolerance:
            _check_pose(pose, pusher_of(goal, pose.body, bodies), scene, bodies, feasibility)


def _check_pose(
    pose: BodyPose, pusher: int, scene: Scene, bodies: Bodies, feasibility: Feasibility
) -> None:
    least, most = _span(scene, pose.body, bodies)
    if pusher != pose.body:
        narrow, wide = _span(scene, pusher, bodies)
        least, most = least + 2 * narrow, most + 2 * wide
    tool, reach = feasibility.limits.tool_radius, feasibility.reach
    away = unit(np.linspace(-np.pi, np.pi, SIDES, endpoint=False))
    place = np.array([pose.x, pose.y])
    for behind in (least + tool, most + tool, most + tool + SLIDE):
        if reach.contains(place - behind * away).any():
            return
    raise UnreachableError(
        f"the goal ({pose.x:.3f}, {pose.y:.3f}) m of body {pose.body} is out of reach: the tool"
        f" would have to stand {least + tool:.2f} m behind it, {reach.inner} to {reach.outer} m"
        " from the arm's base"
    )


def _span(scene: Scene, body: int, bodies: Bodies) -> tuple[float, float]:
    """Return the radii [m] of a body's inscribed and circumscribed circles."""
    shape, radius = bodies.shapes[body], float(scene[body, RADIUS])
    inscribed = 1.0 if shape.is_round else outline_of(shape).inscribed
    return inscribed * radius, shape.circumradius * radius
