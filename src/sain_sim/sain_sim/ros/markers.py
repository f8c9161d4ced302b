"""Markers of table, disks, tool and labels for RViz and other viewers."""

from typing import Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Vector3
from visualization_msgs.msg import Marker

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.push import TOOL_RADIUS
from sain_core.ros.markers import body_marker, make_marker, make_pose
from sain_core.scene import DISK_HEIGHT, Table, X, Y
from sain_core.shapes.bodies import Bodies, Role
from sain_core.types import Scene
from sain_sim.world.workcell import Sample

TABLE_THICKNESS: Final = 0.02  # [m]
TOOL_LENGTH: Final = 0.22  # [m]
LABEL_HEIGHT: Final = 0.03  # [m]
TABLE_COLOUR: Final = (0.86, 0.84, 0.80, 1.0)
TOOL_COLOUR: Final = (0.25, 0.27, 0.30, 1.0)
LABEL_COLOUR: Final = rgba(PALETTE.ink)
LABELS: Final = ("mid", "target")


def scene_markers(sample: Sample, bodies: Bodies, table: Table, stamp: Time) -> list[Marker]:
    """Return markers of the world as it is; ids are constant."""
    return [*table_markers(sample.scene, bodies, table, stamp), _tool(sample, stamp)]


def table_markers(scene: Scene, bodies: Bodies, table: Table, stamp: Time) -> list[Marker]:
    """Return markers of a scene (N, 8) on its table; ids are constant."""
    markers = [_table(table, stamp)]
    names = body_labels(bodies)
    for disk, (row, shape) in enumerate(zip(scene.tolist(), bodies.shapes, strict=True)):
        markers += [
            body_marker("disks", disk, shape, row, rgba(PALETTE.disk(disk)), stamp),
            _label(disk, names[disk], row, stamp),
        ]
    return markers


def body_labels(bodies: Bodies) -> list[str]:
    """Return the text over each body: the paper's words for its roles, else shape and role."""
    count = len(bodies)
    if bodies.shapes[0].is_round and bodies.has_paper_roles:
        return [*LABELS, *(f"disk {disk}" for disk in range(len(LABELS), count))][:count]
    return [
        f"{body} {shape.name}" + (f" ({role})" if role is not Role.PUSHABLE else "")
        for body, (shape, role) in enumerate(zip(bodies.shapes, bodies.roles, strict=True))
    ]


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


def _label(disk: int, text: str, row: list[float], stamp: Time) -> Marker:
    marker = make_marker("labels", disk, Marker.TEXT_VIEW_FACING, LABEL_COLOUR, stamp)
    marker.pose = make_pose(row[X], row[Y], DISK_HEIGHT + LABEL_HEIGHT)
    marker.scale = Vector3(z=LABEL_HEIGHT)
    marker.text = text
    return marker
