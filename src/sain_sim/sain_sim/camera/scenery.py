"""What a camera sees beside the arm: table, bodies and goal."""

from typing import Any, Final

import numpy as np

from sain_core.scene import DISK_HEIGHT, Table, unit
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import Triangles
from sain_core.types import Points
from sain_core.view.palette import PALETTE, rgba
from sain_sim.arm.client import Client

TABLE_COLOR: Final = (0.80, 0.75, 0.68, 1.0)
TOP_COLOR: Final = (0.91, 0.89, 0.86, 1.0)
GOAL_COLOR: Final = rgba(PALETTE.goal)
MARK_COLOR: Final = (1.0, 1.0, 1.0, 1.0)
RING_WIDTH: Final = 0.008  # [m]
RING_LIFT: Final = 0.001  # [m]
TOP_THICKNESS: Final = 0.02  # [m]
OFF_STAGE: Final = (0.0, 0.0, -50.0)
CORNERS: Final = 72  # of a ring

Mesh = dict[str, Any]  # the keyword arguments of ``createVisualShape`` that describe a mesh


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


def build_disk(client: Client, colour: str, shape: str, radius: float, marked: bool = True) -> int:
    """Build a body, with a mark on its top that shows how it is turned, or without."""
    visual = client.createVisualShape(
        client.GEOM_MESH,
        rgbaColor=rgba(PALETTE.named(colour)),
        specularColor=[0.3, 0.3, 0.3],
        **flat_faces(get_shape(shape).triangles(radius)),
    )
    if not marked:
        bare: int = client.createMultiBody(0.0, -1, visual)
        return bare
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


def build_ring(client: Client, radius: float) -> int:
    """Build a flat ring on the table whose middle line has this radius [m]."""
    mesh = ring(radius, RING_WIDTH, RING_LIFT)
    return _show_shape(client, OFF_STAGE, GOAL_COLOR, client.GEOM_MESH, **mesh)


def build_mark(client: Client, corners: Points) -> int:
    """Build a flat outline on the table along corners (C, 2) [m], counter-clockwise."""
    mesh = band(corners, RING_WIDTH, RING_LIFT)
    return _show_shape(client, [0.0, 0.0, 0.0], GOAL_COLOR, client.GEOM_MESH, **mesh)


def _show_shape(
    client: Client, place: Any, color: tuple[float, ...], kind: int, **shape: Any
) -> int:
    visual = client.createVisualShape(
        kind, rgbaColor=color, specularColor=[0.05, 0.05, 0.05], **shape
    )
    body: int = client.createMultiBody(0.0, -1, visual, place)
    return body


def ring(radius: float, width: float, height: float) -> Mesh:
    """Return a flat ring, seen from above, at a height [m] over its origin."""
    return band(radius * unit(np.arange(CORNERS) * 2 * np.pi / CORNERS), width, height)


def band(corners: Points, width: float, height: float) -> Mesh:
    """Return a flat band along a closed line (C, 2), counter-clockwise, at a height [m]."""
    ways = np.roll(corners, -1, axis=0) - corners
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    after = np.stack([ways[:, 1], -ways[:, 0]], axis=1)  # outward normals of the sides
    before = np.roll(after, 1, axis=0)
    mitre = (before + after) / (1.0 + (before * after).sum(axis=1, keepdims=True))
    lift = np.full((len(corners), 1), height)
    inner, outer = (np.hstack([corners + side * width / 2 * mitre, lift]) for side in (-1, 1))
    ahead = [np.roll(edge, -1, axis=0) for edge in (inner, outer)]
    halves = [(outer, ahead[1], ahead[0]), (outer, ahead[0], inner)]
    return flat_faces(np.concatenate([np.stack(half, axis=1) for half in halves]))


def flat_faces(triangles: Triangles) -> Mesh:
    """Return a body with sharp edges from its triangles (T, 3, 3) [m]."""
    first, second, third = np.moveaxis(triangles, 1, 0)
    normals = np.cross(second - first, third - first)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return {
        "vertices": triangles.reshape(-1, 3).tolist(),
        "normals": np.repeat(normals, 3, axis=0).tolist(),
        "indices": list(range(3 * len(triangles))),
    }
