"""A goal as a message, and back."""

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time

from sain_core import wire
from sain_core.ros import codec
from sain_interfaces.msg import Goal, GoalPose
from sain_mppi.loop.decision import Task
from sain_mppi.search.poses import TOLERANCE, TURN_PER_METRE, BodyPose, PoseGoal


def decode_task(message: Any) -> Task:
    """Return what a ``Goal``, received or recorded, asks for: poses, or a place for the target.

    Raises:
        SainError: NaN or Inf in a pose, too many poses, a tolerance that is not positive.
    """
    bodies, values = wire.decode_goal_poses(message)
    ids = message.goal_id, message.episode_id
    if not len(bodies):
        place = np.array([message.x, message.y])
        return Task(*ids, place, message.tolerance or TOLERANCE, message.max_pushes)
    poses = []
    for body, row in zip(bodies.tolist(), values.tolist(), strict=True):
        x, y, heading, tolerance, turn = row
        tolerance = tolerance or TOLERANCE
        turn = turn or TURN_PER_METRE * tolerance
        if np.isnan(heading):
            poses.append(BodyPose(body, x, y, tolerance=tolerance))
        else:
            poses.append(BodyPose(body, x, y, heading, tolerance, turn))
    kept = {"keep_tolerance": message.keep_tolerance} if message.keep_tolerance else {}
    goal = PoseGoal(tuple(poses), tuple(message.keep), **kept)
    return Task(*ids, goal, max(pose.tolerance for pose in poses), message.max_pushes)


def encode_pose_goal(
    goal: PoseGoal, *, stamp: Time, goal_id: int, episode_id: int = 0, max_pushes: int = 0
) -> Goal:
    """Return a goal of poses; x, y and tolerance are the first one's, for whom knows no poses."""
    first = goal.poses[0]
    return Goal(
        header=codec.header(stamp),
        goal_id=goal_id,
        episode_id=episode_id,
        x=first.x,
        y=first.y,
        tolerance=first.tolerance,
        max_pushes=max_pushes,
        poses=[_pose(pose) for pose in goal.poses],
        keep=list(goal.keep),
        keep_tolerance=goal.keep_tolerance,
    )


def _pose(pose: BodyPose) -> GoalPose:
    return GoalPose(
        body=pose.body,
        x=pose.x,
        y=pose.y,
        heading=pose.heading or 0.0,
        has_heading=pose.heading is not None,
        tolerance=pose.tolerance,
        heading_tolerance=pose.heading_tolerance,
    )
