"""The outline of an object without a tag, from one look: what stands on the table, in depth.

The top ends where half of a pixel is top. The rays there meet the plane of the top, so that the
outline is as exact as the camera's pose, not as a single distance.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from numpy import ndarray

from sain_core.errors import InvalidInputError
from sain_core.guarding.untrusted import MOST_RADIUS
from sain_core.shapes.outlines import few_corners
from sain_core.types import Points
from sain_vision.detection.sighting import FOUND, draw_line
from sain_vision.optics import CameraModel

LOWEST: Final = 0.008  # [m] above the table, below which nothing counts
HIGHEST: Final = 0.3  # [m], above which it is the arm or a hand
HEIGHT_ERROR: Final = 0.006  # [m], largest
FINER: Final = 4  # times as many pixels as the image has, for the edge of the top
SMALLEST: Final = 100  # pixels of a top
EDGE: Final = 0.95  # of an object's heights, that its top is as high as
SPREAD: Final = 6.0  # median errors of a height that one of the top may have: 4 standard deviations
FINEST_ERROR: Final = 0.001  # [m], of a height

Depth = Float[ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class TracedTop:
    """The top of an object."""

    outline: Points  # (M, 2) [m] in the world, counter-clockwise
    height: float  # of the top over the table [m]
    tolerance: float  # within which corners were left out [m]
    count: int = 1  # of objects in the image, of which it is one


def trace_top(depth: Depth, camera: CameraModel, near: Float[ndarray, "2"] | None) -> TracedTop:
    """Return the top of the object in a depth image [m] that is nearest to a place, or largest.

    Raises `InvalidInputError`: nothing stands there, or it is cut by the image's edge;
    `DatasetError`: it has too many corners.
    """
    points = camera.place + depth[..., None] * camera.rays_of_all()
    heights = np.nan_to_num(points[..., 2], nan=-1.0)
    stands = (heights > LOWEST) & (heights < HIGHEST)
    mask, count = _chosen(stands, points[..., :2], near)
    height = float(np.quantile(heights[mask], EDGE))
    upper = heights[mask & (abs(heights - height) < HEIGHT_ERROR)]
    height = float(np.median(upper))
    # Sides that the camera sees are no top: the error that is allowed is that of this image.
    error = float(np.clip(SPREAD * np.median(abs(upper - height)), FINEST_ERROR, HEIGHT_ERROR))
    edge = camera.on_plane(_edge(mask & (abs(heights - height) < error)), height)
    if not np.isfinite(edge).all():
        raise InvalidInputError(
            "the object lies where the camera does not look down onto the table, or where the"
            " distortion of its lens cannot be inverted; lay it into the middle of the image"
        )
    outline, tolerance = few_corners(edge)
    return TracedTop(outline, height, tolerance, count)


def _chosen(
    stands: Bool[ndarray, "height width"],
    places: Float[ndarray, "height width 2"],
    near: Float[ndarray, "2"] | None,
) -> tuple[Bool[ndarray, "height width"], int]:
    """Return the pixels of one object that is wholly in the image, and how many are."""
    count, labels, figures, _ = cv2.connectedComponentsWithStats(stands.astype(np.uint8))
    high, wide = stands.shape
    whole: list[tuple[float, int]] = []
    cut = 0
    for label in range(1, count):
        left, top, width, height, area = figures[label]
        if area < SMALLEST:
            continue
        if left == 0 or top == 0 or left + width == wide or top + height == high:
            cut += 1
            continue
        middle = np.median(places[labels == label], axis=0)
        rank = -float(area) if near is None else float(np.hypot(*(middle - near)))
        whole.append((rank, label))
    if not whole:
        more = f"; {cut} that the image's edge cuts do not count" if cut else ""
        raise InvalidInputError(
            f"no object stands on the table in the image{more}: lay it into the middle, away from"
            " the arm, and check the camera's pose"
        )
    away, label = min(whole)
    if near is not None and away > MOST_RADIUS:
        raise InvalidInputError(
            f"the object that is nearest to ({near[0]:g}, {near[1]:g}) m is {away:.2f} m away;"
            " correct --near, which is in the world, or the camera's pose"
        )
    return np.asarray(labels == label), len(whole)


def _edge(top: Bool[ndarray, "height width"]) -> Float[ndarray, "P 2"]:
    """Return the edge (P, 2) [px] of the largest part of a mask, finer than its pixels."""
    smooth = cv2.GaussianBlur(top.astype(np.float32), (0, 0), 1.0)
    high, wide = top.shape
    fine = cv2.resize(smooth, (FINER * wide, FINER * high), interpolation=cv2.INTER_LINEAR)
    contours, _ = cv2.findContours(
        (fine > 0.5).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    if not contours:
        raise InvalidInputError(
            "the object has no flat top that is wider than a pixel or two: is its depth noisy, or"
            " is it an edge of the table? Move the camera nearer, or average more --frames"
        )
    line = max(contours, key=cv2.contourArea)[:, 0].astype(np.float64)
    return np.asarray((line + 0.5) / FINER - 0.5)


def draw_top(
    picture: UInt8[ndarray, "height width 3"], top: TracedTop, camera: CameraModel, text: str
) -> None:
    """Draw an outline into a picture, with its centre and a text."""
    rim = np.column_stack([top.outline, np.full(len(top.outline), top.height)])
    pixels = camera.project(rim)
    draw_line(picture, pixels, FOUND)
    for x, y in pixels.round().astype(int).tolist():
        cv2.circle(picture, (x, y), 2, (40, 160, 255), -1)
    x, y = pixels.min(axis=0).astype(int).tolist()
    cv2.putText(picture, text, (x, max(y - 8, 12)), cv2.FONT_HERSHEY_SIMPLEX, 0.5, FOUND, 1)
