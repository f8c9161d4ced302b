"""What was seen of one body in one image, and a picture of it over this image."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from sain_core.scene import RADIUS, STATE_SIZE
from sain_core.shapes.body_file import BodyFile
from sain_vision.optics import CameraModel

FOUND = (60, 220, 60)  # blue, green, red: what was found in the image
OUTLINE = (255, 160, 40)  # the outline of the body that follows from it
FARTHEST = 3.0  # [m], that is black in a picture of depth
FRACTION = 3  # bits of a pixel in which OpenCV is given places


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where a body is, as an image shows it."""

    body: int  # its place in the file of bodies
    pose: Float[ndarray, "3"]  # (3,) x, y [m] and heading [rad] in the world
    covariance: Float[ndarray, "3 3"]  # (3, 3) of the pose
    outlines: Float[ndarray, "T C 2"]  # (T, C, 2) [px], what it was found by in the image
    score: float = 1.0  # share of what could be seen of it that was, 0 to 1
    rotation: Float[ndarray, "3 3"] | None = None  # to the world, of one that has tipped over


def draw_overlay(
    grey: UInt8[ndarray, "height width"],
    sightings: Iterable[Sighting],
    bodies: BodyFile,
    camera: CameraModel,
) -> UInt8[ndarray, "height width 3"]:
    """Return the image with the tags or edges that were found, and the outlines of the bodies."""
    picture = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    for seen in sightings:
        state = np.zeros(STATE_SIZE)
        state[:3], state[RADIUS] = seen.pose, bodies.radii[seen.body]
        flat = bodies.bodies.shapes[seen.body].placed(state)
        top = np.column_stack([flat, np.full(len(flat), bodies.heights[seen.body])])
        if seen.rotation is None:
            draw_line(picture, camera.project(top), OUTLINE)
        for outline in seen.outlines:
            draw_line(picture, outline, FOUND)
        x, y = camera.project(np.array([[*seen.pose[:2], bodies.heights[seen.body]]]))[0]
        if np.isfinite((x, y)).all():
            text, place = bodies.names[seen.body], (int(x) + 4, int(y) - 4)
            cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, OUTLINE, 1)
    return picture


def draw_line(picture: ndarray, pixels: ndarray, colour: tuple[int, int, int]) -> None:
    """Draw a closed line of pixels (M, 2) into a picture; nothing where one of them is unknown."""
    if np.isfinite(pixels).all():
        fixed = (pixels * 2**FRACTION).round().astype(np.int32)
        cv2.polylines(picture, [fixed], True, colour, 1, cv2.LINE_AA, FRACTION)


def grey_of(depth: Float[ndarray, "height width"]) -> UInt8[ndarray, "height width"]:
    """Return depth [m] as brightness, near is bright."""
    share = 1.0 - np.nan_to_num(depth, nan=FARTHEST) / FARTHEST
    return np.asarray(255 * np.clip(share, 0.0, 1.0), dtype=np.uint8)
