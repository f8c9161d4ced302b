"""What viewers draw of a plan: goal, expected ways, what else was tried, where the push may lead.

RViz and Foxglove show them side by side with the simulator's disks.
"""

from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from jaxtyping import Float
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.ros.markers import Colour, make_marker, make_pose
from sain_core.scene import DISK_HEIGHT, MID, RADIUS, TARGET, THETA, X, Y
from sain_core.types import Points, Scene
from sain_mppi.loop.decision import PushDecision, Task
from sain_mppi.search.result import Shown

LINE_WIDTH: Final = 0.006  # [m]
GOAL_HEIGHT: Final = 0.002  # [m]
THIN_LINE: Final = 0.0015  # [m]
GOAL_COLOUR: Final = rgba(PALETTE.goal, 0.8)
PATH_COLOURS: Final = {disk: rgba(PALETTE.disk(disk), 0.9) for disk in (MID, TARGET)}

GHOST_ALPHA: Final = 0.25
REGION_COLOUR: Final = (0.96, 0.76, 0.20, 0.35)
CHEAP: Final = np.array([0.20, 0.60, 0.35, 0.6])
DEAR: Final = np.array([0.75, 0.25, 0.20, 0.15])

State = Float[np.ndarray, "8"]


def plan_markers(decision: PushDecision, stamp: Time) -> MarkerArray:
    """Return the goal and, for mid disk and target, the way that the plan expects."""
    job, result = decision.job, decision.plan
    array = goal_markers(job.task, stamp)
    if result is None:
        return array
    array.markers.append(_others(job.view.scene, result.others, stamp))
    for disk, colour in PATH_COLOURS.items():
        array.markers.append(_path(disk, result.way(job.view.scene, disk), colour, stamp))
        array.markers.append(_ghost(disk, result.predicted[0, disk], colour, stamp))
        radius = 0.0 if result.regions is None else float(result.regions[0, disk])
        array.markers.append(_region(disk, result.predicted[0, disk], radius, stamp))
    return array


def goal_markers(task: Task, stamp: Time) -> MarkerArray:
    """Return the goal as a flat disk, as wide as the tolerance allows."""
    marker = make_marker("goal", 0, Marker.CYLINDER, GOAL_COLOUR, stamp)
    x, y = task.goal.tolist()
    marker.pose = make_pose(x, y, GOAL_HEIGHT / 2)
    marker.scale = Vector3(x=2 * task.tolerance, y=2 * task.tolerance, z=GOAL_HEIGHT)
    return MarkerArray(markers=[marker])


def _path(disk: int, way: Points, colour: Colour, stamp: Time) -> Marker:
    marker = make_marker("path", disk, Marker.LINE_STRIP, colour, stamp)
    marker.scale = Vector3(x=LINE_WIDTH)
    marker.points = [Point(x=x, y=y, z=DISK_HEIGHT) for x, y in way.tolist()]
    return marker


def _others(scene: Scene, others: Shown, stamp: Time) -> Marker:
    """Return where other sequences lead the target, from green (cheap) to a pale red (dear)."""
    marker = make_marker("others", 0, Marker.LINE_LIST, (0.0, 0.0, 0.0, 1.0), stamp)
    marker.scale = Vector3(x=THIN_LINE)
    count, horizon = others.predicted.shape[:2]
    if not count:
        marker.action = Marker.DELETE
        return marker
    ways = others.ways(scene, TARGET)
    legs = np.stack([ways[:, :-1], ways[:, 1:]], axis=2)  # (R, H, 2, 2), from and to
    marker.points = [Point(x=x, y=y, z=DISK_HEIGHT) for x, y in legs.reshape(-1, 2).tolist()]
    rank = np.linspace(0.0, 1.0, count)[:, None]
    for red, green, blue, alpha in ((1.0 - rank) * CHEAP + rank * DEAR).tolist():
        colour = ColorRGBA(r=red, g=green, b=blue, a=alpha)
        marker.colors.extend([colour] * (2 * horizon))
    return marker


def _ghost(disk: int, state: State, colour: Colour, stamp: Time) -> Marker:
    """Return a disk where it should be after the push."""
    marker = make_marker("ghost", disk, Marker.CYLINDER, (*colour[:3], GHOST_ALPHA), stamp)
    x, y, heading, radius = state[[X, Y, THETA, RADIUS]].tolist()
    marker.pose = make_pose(x, y, DISK_HEIGHT / 2, heading)
    marker.scale = Vector3(x=2 * radius, y=2 * radius, z=DISK_HEIGHT)
    return marker


def _region(disk: int, state: State, radius: float, stamp: Time) -> Marker:
    """Return the region that should hold a disk's centre after the push; none where unknown."""
    marker = make_marker("region", disk, Marker.CYLINDER, REGION_COLOUR, stamp)
    if radius <= 0.0:
        marker.action = Marker.DELETE
    x, y = state[[X, Y]].tolist()
    marker.pose = make_pose(x, y, DISK_HEIGHT + LINE_WIDTH)
    marker.scale = Vector3(x=2 * radius, y=2 * radius, z=GOAL_HEIGHT)
    return marker
