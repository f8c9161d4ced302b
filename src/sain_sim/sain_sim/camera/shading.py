"""Soft shadows on the table, computed and not traced: the software renderer's are jagged.

Under parallel light an upright cylinder shades the capsule between its base and its shifted
top. A pixel of the table is darkened by how deep it lies in such a capsule.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

SOFTNESS: Final = 0.022  # [m], width of a shadow's edge
DARKNESS: Final = 0.34  # share of the light that a full shadow takes

Rays = Float[ndarray, "height width 2"]


class Caster(NamedTuple):
    """An upright cylinder that casts a shadow."""

    x: float  # [m]
    y: float  # [m]
    radius: float  # [m]
    bottom: float  # [m] over the table
    top: float  # [m] over the table


def table_points(
    view: Sequence[float], projection: Sequence[float], width: int, height: int
) -> Rays:
    """Return where each pixel's ray meets the table plane, (height, width, 2) [m]; NaN: nowhere.

    View and projection are OpenGL matrices, 16 numbers each, column by column.
    """
    matrix = np.reshape(projection, (4, 4)).T @ np.reshape(view, (4, 4)).T
    across = (np.arange(width) + 0.5) / width * 2 - 1
    down = 1 - (np.arange(height) + 0.5) / height * 2
    grid = np.stack(np.meshgrid(across, down), axis=-1)  # (height, width, 2)
    ends = []
    for depth in (-1.0, 1.0):
        flat = np.broadcast_to([depth, 1.0], grid.shape)
        world = np.concatenate([grid, flat], axis=-1) @ np.linalg.inv(matrix).T
        ends.append(world[..., :3] / world[..., 3:])
    near, far = ends
    drop = near[..., 2] - far[..., 2]
    share = np.where(drop > 0, near[..., 2] / np.where(drop > 0, drop, 1.0), np.nan)
    return np.asarray((near + share[..., None] * (far - near))[..., :2])


def brightness(points: Rays, casters: list[Caster], light: tuple[float, float, float]) -> ndarray:
    """Return what share of a light from this direction reaches points, (height, width, 1)."""
    lean = -np.array(light[:2]) / light[2]  # a shadow's shift for each metre of height
    bright = np.ones(points.shape[:2])
    for caster in casters:
        base = np.array([caster.x, caster.y])
        first, last = base + caster.bottom * lean, base + caster.top * lean
        inside = caster.radius - _distance(points, first, last)
        depth = np.clip(0.5 + inside / SOFTNESS, 0.0, 1.0)
        bright = np.minimum(bright, 1 - DARKNESS * depth * depth * (3 - 2 * depth))
    return np.nan_to_num(bright, nan=1.0)[..., None]


def _distance(points: Rays, first: ndarray, last: ndarray) -> ndarray:
    """Return the distance of points to the segment from first to last [m]."""
    way = last - first
    offset = points - first
    along = np.clip(offset @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    return np.hypot(*np.moveaxis(offset - along[..., None] * way, -1, 0))
