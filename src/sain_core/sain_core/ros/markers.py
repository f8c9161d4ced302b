"""Markers for RViz and Foxglove."""

from collections.abc import Sequence
from math import cos, sin
from typing import Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.ros.codec import header
from sain_core.ros.qos import RELIABLE
from sain_core.scene import DISK_HEIGHT, RADIUS, THETA, X, Y
from sain_core.shapes.shape import Shape, Solid
from sain_core.types import Points

Colour = tuple[float, float, float, float]  # red, green, blue, alpha

SOLIDS: Final = {
    Solid.CYLINDER: Marker.CYLINDER,
    Solid.BOX: Marker.CUBE,
    Solid.PRISM: Marker.TRIANGLE_LIST,
}


class MarkerBoard:
    """A topic of markers: viewers show those of the latest array and no others.

    Viewers keep a marker until it is deleted by group and number, so each array also deletes
    all that earlier ones had. A new viewer may still have markers of a former node: all go.
    """

    def __init__(self, node: Node, topic: str) -> None:
        """Publish on this topic."""
        self._publisher = node.create_publisher(MarkerArray, topic, RELIABLE)
        self._shown: set[tuple[str, int]] = set()
        self._viewers = 0

    def show(self, markers: Sequence[Marker]) -> None:
        """Show these markers in place of the earlier ones."""
        now = {(marker.ns, marker.id) for marker in markers}
        gone = [
            Marker(ns=group, id=number, action=Marker.DELETE)
            for group, number in sorted(self._shown - now)
        ]
        self._shown |= now
        array = MarkerArray(markers=[*markers, *gone])
        viewers = self._publisher.get_subscription_count()
        if viewers != self._viewers:
            array.markers.insert(0, Marker(action=Marker.DELETEALL))
            self._viewers = viewers
        self._publisher.publish(array)


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


def body_marker(
    group: str, number: int, shape: Shape, state: Sequence[float], colour: Colour, stamp: Time
) -> Marker:
    """Return a body in a state (8,) as it is: a cylinder, a box, or the surface of its prisms."""
    marker = make_marker(group, number, SOLIDS[shape.solid], colour, stamp)
    marker.pose = make_pose(state[X], state[Y], DISK_HEIGHT / 2, state[THETA])
    width = 2 * state[RADIUS]
    marker.scale = Vector3(x=width, y=width, z=DISK_HEIGHT)
    if shape.solid is Solid.PRISM:
        marker.scale = Vector3(x=1.0, y=1.0, z=1.0)
        corners = shape.triangles(state[RADIUS]).reshape(-1, 3).tolist()
        marker.points = [Point(x=x, y=y, z=z) for x, y, z in corners]
    return marker


def line_marker(
    group: str,
    number: int,
    points: Points,
    height: float,
    width: float,
    colour: Colour,
    stamp: Time,
) -> Marker:
    """Return a line through points (M, 2) [m] in the world, at a height."""
    marker = make_marker(group, number, Marker.LINE_STRIP, colour, stamp)
    marker.scale = Vector3(x=width)
    marker.points = [Point(x=x, y=y, z=height) for x, y in points.tolist()]
    return marker
