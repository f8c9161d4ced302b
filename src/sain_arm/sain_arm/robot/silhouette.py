"""Where a camera sees things of a MuJoCo model: as convex outlines in its image."""

from collections.abc import Callable, Iterable
from typing import Any, Final

import cv2
import mujoco
import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

CORNERS: Final = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
HULL: Final = 200  # points of a mesh that stand for all, the outermost ones

Places = Float[ndarray, "P 3"]  # [m]
Project = Callable[[Places], Float[ndarray, "P 2"]]  # to pixels; NaN: behind the camera


class Silhouettes:
    """The convex hulls of a model's geometries, in pixels."""

    def __init__(self, model: Any, geoms: Iterable[int]) -> None:
        """Take the outermost points of these geometries."""
        self._points = {geom: _outermost(model, geom) for geom in geoms}

    def draw(
        self, data: Any, project: Project, width: int, height: int, margin: int
    ) -> Bool[ndarray, "height width"]:
        """Return which pixels may show a geometry, as data has all, and so many [px] around it."""
        mask = np.zeros((height, width), np.uint8)
        for geom, points in self._points.items():
            places = points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            pixels = project(places)
            if not np.isfinite(pixels).all():
                if np.isfinite(pixels).any():
                    mask[:] = 1  # partly behind the camera: it may be anywhere
                continue
            near = np.clip(pixels, -4.0 * width, 4.0 * width).round().astype(np.int32)
            hull = cv2.convexHull(near)
            cv2.fillConvexPoly(mask, hull, 1)
            if margin:
                cv2.polylines(mask, [hull], True, 1, 2 * margin + 1)
        return mask > 0


def _outermost(model: Any, geom: int) -> Places:
    """Return points in the frame of a geometry whose convex hull has it within."""
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        return np.asarray(middle + CORNERS * half)
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    points = np.array(model.mesh_vert[start : start + count], dtype=np.float64)
    if count <= HULL:
        return points
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]
