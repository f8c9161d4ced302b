"""The contents of a picture: a table, disks with a mark of their heading, a ring about a goal."""

from typing import Any, Final

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.scene import DISK_HEIGHT, Table
from sain_core.shapes.registry import get_shape
from sain_core.shapes.shape import Shape, Solid
from sain_sim.arm.client import Client
from sain_sim.rendering.meshes import Mesh, cylinder, flat_faces, ring

TABLE_COLOR: Final = (0.80, 0.75, 0.68, 1.0)
TOP_COLOR: Final = (0.91, 0.89, 0.86, 1.0)
GOAL_COLOR: Final = rgba(PALETTE.goal)
MARK_COLOR: Final = (1.0, 1.0, 1.0, 1.0)
RING_WIDTH: Final = 0.008  # [m]
RING_LIFT: Final = 0.001  # [m]
TOP_THICKNESS: Final = 0.02  # [m]
OFF_STAGE: Final = (0.0, 0.0, -50.0)


def build_table(client: Client, table: Table) -> int:
    """Build and return a light table top on a darker block down to the height of the base."""
    middle = [(table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2]
    size = [(table.x_max - table.x_min) / 2, (table.y_max - table.y_min) / 2]
    top = [*size, TOP_THICKNESS / 2]
    under = max(table.height, 2 * TOP_THICKNESS) - TOP_THICKNESS
    block = [size[0] * 0.97, size[1] * 0.97, under / 2]
    center = [*middle, -TOP_THICKNESS - under / 2]
    _show_shape(client, center, TABLE_COLOR, client.GEOM_BOX, halfExtents=block)
    center = [*middle, -TOP_THICKNESS / 2]
    return _show_shape(client, center, TOP_COLOR, client.GEOM_BOX, halfExtents=top)


def build_disk(client: Client, index: int, shape: str, radius: float) -> int:
    """Build a disk with a mark on its top that shows how it is turned."""
    kind, geometry = _solid(client, get_shape(shape), radius)
    visual = client.createVisualShape(
        kind,
        rgbaColor=rgba(PALETTE.disk(index)),
        specularColor=[0.3, 0.3, 0.3],
        **geometry,
    )
    mark = client.createVisualShape(
        client.GEOM_BOX,
        halfExtents=[radius * 0.25, 0.005, 0.0006],
        rgbaColor=MARK_COLOR,
        specularColor=[0.0, 0.0, 0.0],
    )
    body: int = client.createMultiBody(
        baseMass=0.0,
        baseCollisionShapeIndex=-1,
        baseVisualShapeIndex=visual,
        linkMasses=[0.0],
        linkCollisionShapeIndices=[-1],
        linkVisualShapeIndices=[mark],
        linkPositions=[[radius * 0.66, 0.0, DISK_HEIGHT / 2 + 0.0006]],
        linkOrientations=[[0, 0, 0, 1]],
        linkInertialFramePositions=[[0, 0, 0]],
        linkInertialFrameOrientations=[[0, 0, 0, 1]],
        linkParentIndices=[0],
        linkJointTypes=[client.JOINT_FIXED],
        linkJointAxis=[[0, 0, 1]],
    )
    return body


def _solid(client: Client, shape: Shape, radius: float) -> tuple[int, Mesh]:
    """Return Bullet's kind of visual shape for a body, and what describes it."""
    half = DISK_HEIGHT / 2
    if shape.solid is Solid.BOX:
        return client.GEOM_BOX, {"halfExtents": [radius, radius, half]}
    if shape.solid is Solid.CYLINDER:
        return client.GEOM_MESH, cylinder(radius, -half, half)
    return client.GEOM_MESH, flat_faces(shape.triangles(radius))


def build_ring(client: Client, radius: float) -> int:
    """Build a flat ring on the table whose middle line has this radius [m]."""
    mesh = ring(radius, RING_WIDTH, RING_LIFT)
    return _show_shape(client, OFF_STAGE, GOAL_COLOR, client.GEOM_MESH, **mesh)


def _show_shape(
    client: Client, place: Any, color: tuple[float, ...], kind: int, **shape: Any
) -> int:
    visual = client.createVisualShape(
        kind, rgbaColor=color, specularColor=[0.05, 0.05, 0.05], **shape
    )
    body: int = client.createMultiBody(0.0, -1, visual, place)
    return body
