"""Markers of table, disks, tool and labels for RViz and other viewers."""

from typing import Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.push import TOOL_RADIUS
from sain_core.ros.markers import make_marker, make_pose
from sain_core.scene import DISK_HEIGHT, RADIUS, THETA, Table, X, Y
from sain_core.shapes.registry import get_shape
from sain_core.shapes.shape import Shape, Solid
from sain_sim.world.outcome import Sample

TABLE_THICKNESS: Final = 0.02  # [m]
TOOL_LENGTH: Final = 0.22  # [m]
LABEL_HEIGHT: Final = 0.03  # [m]
TABLE_COLOUR: Final = (0.86, 0.84, 0.80, 1.0)
TOOL_COLOUR: Final = (0.25, 0.27, 0.30, 1.0)
LABEL_COLOUR: Final = rgba(PALETTE.ink)
SOLIDS: Final = {
    Solid.CYLINDER: Marker.CYLINDER,
    Solid.BOX: Marker.CUBE,
    Solid.PRISM: Marker.TRIANGLE_LIST,
}
LABELS: Final = ("mid", "target")


def scene_markers(
    sample: Sample, shapes: tuple[str, ...], table: Table, stamp: Time
) -> MarkerArray:
    """Return markers of the world as it is; ids are constant."""
    array = MarkerArray(markers=[_table(table, stamp), _tool(sample, stamp)])
    for disk, (row, shape) in enumerate(zip(sample.scene.tolist(), shapes, strict=True)):
        array.markers += [_disk(disk, row, get_shape(shape), stamp), _label(disk, row, stamp)]
    return array


def _table(table: Table, stamp: Time) -> Marker:
    marker = make_marker("table", 0, Marker.CUBE, TABLE_COLOUR, stamp)
    centre = ((table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2)
    marker.pose = make_pose(*centre, -TABLE_THICKNESS / 2)
    marker.scale = Vector3(
        x=table.x_max - table.x_min, y=table.y_max - table.y_min, z=TABLE_THICKNESS
    )
    return marker


def _tool(sample: Sample, stamp: Time) -> Marker:
    marker = make_marker("tool", 0, Marker.CYLINDER, TOOL_COLOUR, stamp)
    x, y, z = sample.tool.tolist()
    marker.pose = make_pose(x, y, z + TOOL_LENGTH / 2)
    marker.scale = Vector3(x=2 * TOOL_RADIUS, y=2 * TOOL_RADIUS, z=TOOL_LENGTH)
    return marker


def _disk(disk: int, row: list[float], shape: Shape, stamp: Time) -> Marker:
    marker = make_marker("disks", disk, SOLIDS[shape.solid], rgba(PALETTE.disk(disk)), stamp)
    marker.pose = make_pose(row[X], row[Y], DISK_HEIGHT / 2, row[THETA])
    width = 2 * row[RADIUS]
    marker.scale = Vector3(x=width, y=width, z=DISK_HEIGHT)
    if shape.solid is Solid.PRISM:
        marker.scale = Vector3(x=1.0, y=1.0, z=1.0)
        corners = shape.triangles(row[RADIUS]).reshape(-1, 3).tolist()
        marker.points = [Point(x=x, y=y, z=z) for x, y, z in corners]
    return marker


def _label(disk: int, row: list[float], stamp: Time) -> Marker:
    marker = make_marker("labels", disk, Marker.TEXT_VIEW_FACING, LABEL_COLOUR, stamp)
    marker.pose = make_pose(row[X], row[Y], DISK_HEIGHT + LABEL_HEIGHT)
    marker.scale = Vector3(z=LABEL_HEIGHT)
    marker.text = LABELS[disk] if disk < len(LABELS) else f"disk {disk}"
    return marker
