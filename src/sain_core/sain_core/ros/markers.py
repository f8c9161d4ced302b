"""Things to draw as markers, for RViz, Foxglove and other viewers."""

from collections.abc import Iterable, Sequence
from math import cos, sin
from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.push import TOOL_RADIUS
from sain_core.ros.codec import header
from sain_core.ros.qos import RELIABLE
from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.bodies import MOST_BODIES
from sain_core.shapes.shape import Solid
from sain_core.types import Place, Points
from sain_core.view.palette import PALETTE, rgba
from sain_core.view.things import (
    BodyPath,
    DrawnBody,
    GoalMark,
    Look,
    PushArrow,
    ReachArea,
    Region,
    TableTop,
    Thing,
    hue,
)

SOLIDS: Final = {
    Solid.CYLINDER: Marker.CYLINDER,
    Solid.BOX: Marker.CUBE,
    Solid.PRISM: Marker.TRIANGLE_LIST,
}
TABLE_THICKNESS: Final = 0.02  # [m]
TABLE_COLOUR: Final = "#dbd6cc"  # darker than on paper: RViz lights it
TOOL_COLOUR: Final = "#40454d"
TOOL_LENGTH: Final = 0.22  # [m]
LABEL_HEIGHT: Final = 0.03  # [m]
LINE: Final = 0.006  # [m], width of lines
THIN: Final = 0.0015  # [m]
FLAT: Final = 0.002  # [m], height of what lies on the table
ARROW: Final = (0.008, 0.02, 0.024)  # [m], width of the shaft, width and length of the head
OPACITY: Final = {Look.NOW: 1.0, Look.PLANNED: 0.25}  # of bodies; of other looks 0.4
OTHERS: Final = (0.6, 0.15)  # opacity of the cheapest sequence and of the dearest


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


def markers_of(things: Iterable[Thing], stamp: Time) -> list[Marker]:
    """Return the markers of things, numbered by body; further ones of a body have higher numbers.

    The same things always have the same groups and numbers.
    """
    things = list(things)
    others = [thing for thing in things if isinstance(thing, BodyPath) and _is_other(thing)]
    markers = _other_lines(others)
    taken: set[tuple[str, int]] = set()
    for thing in things:
        for marker in _markers(thing):
            marker.id = getattr(thing, "number", 0)
            while (marker.ns, marker.id) in taken:
                marker.id += MOST_BODIES
            taken.add((marker.ns, marker.id))
            markers.append(marker)
    for marker in markers:
        marker.header = header(stamp)
    return markers


def _markers(thing: Thing) -> list[Marker]:
    match thing:
        case TableTop():
            return [_table(thing)]
        case ReachArea():
            rings = map(_closed, thing.outlines)
            return [_line("reach", ring, FLAT, "reach_edge") for ring in rings]
        case DrawnBody():
            return _body(thing)
        case BodyPath():
            line = _line("path", thing.points, DISK_HEIGHT, thing.colour)
            return [] if _is_other(thing) else [line]
        case GoalMark():
            return _goal(thing)
        case PushArrow():
            return [_arrow(thing)]
        case Region():
            return [_region(thing)]


def tool_marker(tip: Sequence[float], stamp: Time) -> Marker:
    """Return the stick of the arm with its tip at x, y, z [m]."""
    marker = make_marker("tool", 0, Marker.CYLINDER, TOOL_COLOUR)
    marker.header = header(stamp)
    x, y, z = tip
    marker.pose = make_pose(x, y, z + TOOL_LENGTH / 2)
    marker.scale = Vector3(x=2 * TOOL_RADIUS, y=2 * TOOL_RADIUS, z=TOOL_LENGTH)
    return marker


def make_marker(group: str, number: int, kind: int, colour: str, opacity: float = 1.0) -> Marker:
    """Return a marker at the origin without header; group and number identify it in viewers."""
    red, green, blue, alpha = rgba(colour, opacity)
    return Marker(
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


def _table(table: TableTop) -> Marker:
    marker = make_marker("table", 0, Marker.CUBE, TABLE_COLOUR)
    x, y = ((table.low + table.high) / 2).tolist()
    wide, long = (table.high - table.low).tolist()
    marker.pose = make_pose(x, y, -TABLE_THICKNESS / 2)
    marker.scale = Vector3(x=wide, y=long, z=TABLE_THICKNESS)
    return marker


def _body(body: DrawnBody) -> list[Marker]:
    """Return a body as it is: a cylinder, a box, or the surface of its prisms; now with a name."""
    now = body.look is Look.NOW
    group = "bodies" if now else body.look.value
    opacity = OPACITY.get(body.look, 0.4)
    marker = make_marker(group, 0, SOLIDS[body.shape.solid], hue(body), opacity)
    x, y = body.place.tolist()
    marker.pose = make_pose(x, y, DISK_HEIGHT / 2, body.heading)
    marker.scale = Vector3(x=2 * body.radius, y=2 * body.radius, z=DISK_HEIGHT)
    if body.shape.solid is Solid.PRISM:
        marker.scale = Vector3(x=1.0, y=1.0, z=1.0)
        corners = body.shape.triangles(body.radius).reshape(-1, 3).tolist()
        marker.points = [Point(x=x, y=y, z=z) for x, y, z in corners]
    if not now:
        return [marker]
    label = make_marker("labels", 0, Marker.TEXT_VIEW_FACING, PALETTE.ink)
    label.pose = make_pose(x, y, DISK_HEIGHT + LABEL_HEIGHT)
    label.scale = Vector3(z=LABEL_HEIGHT)
    label.text = body.name
    return [marker, label]


def _goal(goal: GoalMark) -> list[Marker]:
    """Return a disk as wide as the tolerance, and where the heading counts the outline."""
    disk = _disk("goal", goal.body.place, goal.tolerance, FLAT / 2, hue(goal), 0.8)
    if not goal.body.marked:
        return [disk]
    return [_line("goal", _closed(goal.body.outline), FLAT, goal.colour), disk]


def _region(region: Region) -> Marker:
    height = DISK_HEIGHT + LINE
    return _disk("region", region.place, region.radius, height, hue(region), 0.35)


def _disk(
    group: str, place: Place, radius: float, height: float, colour: str, opacity: float
) -> Marker:
    marker = make_marker(group, 0, Marker.CYLINDER, colour, opacity)
    x, y = place.tolist()
    marker.pose = make_pose(x, y, height)
    marker.scale = Vector3(x=2 * radius, y=2 * radius, z=FLAT)
    return marker


def _arrow(push: PushArrow) -> Marker:
    marker = make_marker("push", 0, Marker.ARROW, hue(push))
    shaft, width, length = ARROW
    marker.scale = Vector3(x=shaft, y=width, z=length)
    marker.points = _points(np.stack([push.start, push.end]), DISK_HEIGHT + LINE)
    return marker


def _line(group: str, points: Points, height: float, colour: str) -> Marker:
    marker = make_marker(group, 0, Marker.LINE_STRIP, PALETTE.named(colour), 0.9)
    marker.scale = Vector3(x=LINE)
    marker.points = _points(points, height)
    return marker


def _other_lines(paths: Sequence[BodyPath]) -> list[Marker]:
    """Return other sequences as one marker: its lines pale from the cheapest to the dearest."""
    if not paths:
        return []
    marker = make_marker("others", 0, Marker.LINE_LIST, PALETTE.ink)
    marker.scale = Vector3(x=THIN)
    for path in paths:
        legs = np.stack([path.points[:-1], path.points[1:]], axis=1).reshape(-1, 2)
        opacity = OTHERS[0] + path.share * (OTHERS[1] - OTHERS[0])
        red, green, blue, alpha = rgba(hue(path), opacity)
        marker.points.extend(_points(legs, DISK_HEIGHT))
        marker.colors.extend([ColorRGBA(r=red, g=green, b=blue, a=alpha)] * len(legs))
    return [marker]


def _is_other(path: BodyPath) -> bool:
    return path.look is Look.OTHER


def _closed(corners: Points) -> np.ndarray:
    return np.concatenate([corners, corners[:1]])


def _points(points: Points, height: float) -> list[Point]:
    return [Point(x=x, y=y, z=height) for x, y in points.tolist()]
