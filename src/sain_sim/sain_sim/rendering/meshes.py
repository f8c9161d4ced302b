"""Meshes for pictures; Bullet's own cylinders are drawn with twelve corners."""

from math import pi
from typing import Any, Final

import numpy as np

from sain_core.shapes.shape import Triangles

CORNERS: Final = 72

Mesh = dict[str, Any]  # the keyword arguments of ``createVisualShape`` that describe a mesh


def ring(radius: float, width: float, height: float) -> Mesh:
    """Return a flat ring, seen from above, at a height [m] over its origin."""
    inner, outer = _circle(radius - width / 2, height), _circle(radius + width / 2, height)
    return _mesh([_band(outer, inner, np.array([0.0, 0.0, 1.0]))])


def cylinder(radius: float, bottom: float, top: float) -> Mesh:
    """Return an upright cylinder from bottom to top [m] with a small rounded edge."""
    edge = min(0.0025, radius / 4)
    turns = _circle(1.0, 0.0)
    low, shoulder = _circle(radius, bottom), _circle(radius, top - edge)
    lid = _circle(radius - edge, top)
    middle = np.broadcast_to([0.0, 0.0, top], lid.shape)
    up = np.array([0.0, 0.0, 1.0])
    slope = (turns + up) / 2**0.5
    return _mesh([_band(low, shoulder, turns), _band(shoulder, lid, slope), _band(lid, middle, up)])


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


def _circle(radius: float, height: float) -> np.ndarray:
    """Return points (CORNERS, 3) on a circle."""
    turn = np.arange(CORNERS) * 2 * pi / CORNERS
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(CORNERS, height)], -1)


def _band(first: np.ndarray, second: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return points, normals and triangles of a band between two circles (CORNERS, 3)."""
    here = np.arange(CORNERS)
    after = (here + 1) % CORNERS
    triangles = np.concatenate(
        [
            np.stack([here, after, after + CORNERS], -1),
            np.stack([here, after + CORNERS, here + CORNERS], -1),
        ]
    )
    points = np.concatenate([first, second])
    return points, np.tile(np.broadcast_to(normals, first.shape), (2, 1)), triangles


def _mesh(bands: list[tuple[np.ndarray, ...]]) -> Mesh:
    offsets = np.cumsum([0] + [len(points) for points, _, _ in bands[:-1]])
    return {
        "vertices": np.concatenate([points for points, _, _ in bands]).tolist(),
        "normals": np.concatenate([normals for _, normals, _ in bands]).tolist(),
        "indices": np.concatenate(
            [triangles + offset for (_, _, triangles), offset in zip(bands, offsets, strict=True)]
        )
        .ravel()
        .tolist(),
    }
