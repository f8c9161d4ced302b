"""What viewers draw of a plan: the goal, and where target and mid disk should go."""

from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.ros.codec import header
from sain_core.scene import DISK_HEIGHT, MID, POSITION, TARGET
from sain_core.types import Points
from sain_mppi.deciding import Decision
from sain_mppi.pursuit import Task

LINE_WIDTH: Final = 0.006  # [m]
GOAL_HEIGHT: Final = 0.002  # [m]
GOAL_COLOUR: Final = (0.16, 0.63, 0.35, 0.8)
PATH_COLOURS: Final = {MID: (0.20, 0.45, 0.75, 0.9), TARGET: (0.85, 0.33, 0.24, 0.9)}

Colour = tuple[float, float, float, float]


def plan_markers(decision: Decision, stamp: Time) -> MarkerArray:
    """Return the goal and, for mid disk and target, the way that the plan expects."""
    job, result = decision.job, decision.result
    array = goal_markers(job.task, stamp)
    for disk, colour in PATH_COLOURS.items():
        way = np.concatenate([job.view.scene[None], result.predicted])[:, disk, POSITION]
        array.markers.append(_path(disk, way, colour, stamp))
    return array


def goal_markers(task: Task, stamp: Time) -> MarkerArray:
    """Return the goal as a flat disk, as wide as the tolerance allows."""
    marker = _marker("goal", 0, Marker.CYLINDER, GOAL_COLOUR, stamp)
    x, y = task.goal.tolist()
    marker.pose = Pose(position=Point(x=x, y=y, z=GOAL_HEIGHT / 2))
    marker.pose.orientation.w = 1.0
    marker.scale = Vector3(x=2 * task.tolerance, y=2 * task.tolerance, z=GOAL_HEIGHT)
    return MarkerArray(markers=[marker])


def _path(disk: int, way: Points, colour: Colour, stamp: Time) -> Marker:
    marker = _marker("path", disk, Marker.LINE_STRIP, colour, stamp)
    marker.pose.orientation.w = 1.0
    marker.scale = Vector3(x=LINE_WIDTH)
    marker.points = [Point(x=x, y=y, z=DISK_HEIGHT) for x, y in way.tolist()]
    return marker


def _marker(group: str, number: int, kind: int, colour: Colour, stamp: Time) -> Marker:
    red, green, blue, alpha = colour
    return Marker(
        header=header(stamp),
        ns=group,
        id=number,
        type=kind,
        action=Marker.ADD,
        color=ColorRGBA(r=red, g=green, b=blue, a=alpha),
    )
