"""Markers for RViz and Foxglove."""

from math import cos, sin

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from sain_core.ros.codec import header

Colour = tuple[float, float, float, float]  # red, green, blue, alpha


def make_marker(group: str, number: int, kind: int, colour: Colour, stamp: Time) -> Marker:
    """Return a marker at the origin; group and number identify it in viewers."""
    red, green, blue, alpha = colour
    return Marker(
        header=header(stamp),
        ns=group,
        id=number,
        type=kind,
        action=Marker.ADD,
        pose=make_pose(0.0, 0.0, 0.0),
        color=ColorRGBA(r=red, g=green, b=blue, a=alpha),
    )


def make_pose(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    """Return an upright pose [m, rad]."""
    turn = Quaternion(z=sin(yaw / 2), w=cos(yaw / 2))
    return Pose(position=Point(x=x, y=y, z=z), orientation=turn)
