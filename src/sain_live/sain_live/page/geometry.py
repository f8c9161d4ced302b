"""Lines, turns and colours for the scene."""

from collections.abc import Sequence
from math import cos, sin

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Points
from sain_core.view.palette import rgba
from sain_core.view.things import DrawnBody

Quaternion = tuple[float, float, float, float]  # w, x, y, z
Vector = tuple[float, float, float]
Rgb = tuple[int, int, int]
Segments = Float[ndarray, "S 2 3"]


def rgb(colour: str) -> Rgb:
    """Return a colour ``#rrggbb`` as whole numbers from 0 to 255."""
    red, green, blue, _ = rgba(colour)
    return round(255 * red), round(255 * green), round(255 * blue)


def upright(heading: float) -> Quaternion:
    """Return the turn about z by a heading [rad]."""
    return cos(heading / 2), 0.0, 0.0, sin(heading / 2)


def heading_of(turn: Sequence[float]) -> float:
    """Return the heading [rad] of a turn about z."""
    return float(2.0 * np.arctan2(turn[3], turn[0]))


def turned(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the turn that is the first one, and in its frame the second."""
    w, x, y, z = first
    a, b, c, d = second
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


def about(axis: Vector, angle: float) -> Quaternion:
    """Return the turn about a unit axis by an angle [rad]."""
    x, y, z = axis
    s = sin(angle / 2)
    return cos(angle / 2), s * x, s * y, s * z


def of_angles(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the turn of fixed-axis roll, pitch and yaw [rad], as in URDF."""
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return turned(turned(about(z, yaw), about(y, pitch)), about(x, roll))


def lifted(points: Points, height: float) -> ndarray:
    """Return points (..., 2) at a height [m], (..., 3)."""
    return np.concatenate([points, np.full((*points.shape[:-1], 1), height)], axis=-1)


def ring(points: Points, height: float) -> Segments:
    """Return the closed line through points (M, 2) at a height [m]."""
    corners = lifted(points, height)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def line(points: Points, height: float) -> Segments:
    """Return the line through points (..., M, 2) at a height [m], as segments (S, 2, 3)."""
    corners = lifted(points, height)
    return np.stack([corners[..., :-1, :], corners[..., 1:, :]], axis=-2).reshape(-1, 2, 3)


def mesh(body: DrawnBody) -> tuple[ndarray, ndarray]:
    """Return vertices (V, 3) [m] and faces (T, 3) of a body about its centre."""
    corners = body.shape.triangles(body.radius).reshape(-1, 3)
    return corners, np.arange(len(corners)).reshape(-1, 3)
