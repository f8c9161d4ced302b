"""AprilTags as AprilTag's own pictures show them, painted into a picture as exact as a print.

With one texel for each pixel the corners of a tag of 35 pixels are off by half a pixel. Here a tag
is drawn four times as large and averaged.
"""

from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from numpy import ndarray

from sain_core.shapes.body_file import Tag

FAMILIES: Final = {
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "16h5": cv2.aruco.DICT_APRILTAG_16h5,
}
QUIET: Final = 1  # modules of white paper around it
TEXELS: Final = 12  # for each module
TIMES: Final = 4  # as large a tag is drawn before it is averaged

Homography = Float[ndarray, "3 3"]
Painting = Float[ndarray, "height width 3"]


@lru_cache
def tag_family(name: str) -> Bool[ndarray, "T M M"]:
    """Return which modules of each tag of a family are black, upright, from the upper left one on.

    Upright is as in the pictures of AprilRobotics/apriltag-imgs. OpenCV has its tags upside down.
    """
    family = cv2.aruco.getPredefinedDictionary(FAMILIES[name])
    side = family.markerSize + 2
    every = range(len(family.bytesList))
    drawn = np.stack([cv2.aruco.generateImageMarker(family, number, side) for number in every])
    return np.asarray(drawn[:, ::-1, ::-1] == 0)


@lru_cache(maxsize=64)
def tag_texture(number: int) -> UInt8[ndarray, "T T"]:
    """Return the picture of a tag of family 36h11 with the paper around it."""
    paper = np.pad(~tag_family("36h11")[number], QUIET, constant_values=True)
    return np.kron(paper, np.ones((TEXELS, TEXELS), bool)).astype(np.uint8) * np.uint8(255)


def paint_tag(
    picture: Painting,
    tag: Tag,
    plane: Homography,
    pose: Float[ndarray, "3"],
    hidden: Bool[ndarray, "height width"],
) -> None:
    """Paint the tag of a body at a pose (x, y, heading) into a picture, but not on hidden pixels.

    The homography maps places [m] in the plane of the tag to pixels.
    """
    texture = tag_texture(tag.number)
    scale, middle = tag.size / (len(texture) - 2 * QUIET * TEXELS), (len(texture) - 1) / 2
    on_paper = scale * np.array([[1.0, 0.0, -middle], [0.0, -1.0, middle], [0.0, 0.0, 1 / scale]])
    to_pixels = plane @ _placed(*pose.tolist()) @ _placed(tag.x, tag.y, tag.angle) @ on_paper
    window = _window(to_pixels, len(texture), picture.shape[1], picture.shape[0])
    if window is None:
        return
    (left, top), (right, bottom) = window
    shift = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, 1.0]])
    enlarged = np.array([[TIMES, 0, (TIMES - 1) / 2], [0, TIMES, (TIMES - 1) / 2], [0, 0, 1.0]])
    wide, high = right - left, bottom - top
    drawn, inside = (
        cv2.warpPerspective(one, enlarged @ shift @ to_pixels, (TIMES * wide, TIMES * high))
        .reshape(high, TIMES, wide, TIMES)
        .mean(axis=(1, 3))
        for one in (texture.astype(np.float32), np.ones(texture.shape, np.float32))
    )
    part = picture[top:bottom, left:right]
    share = np.where(hidden[top:bottom, left:right], 0.0, inside)[..., None]
    part[:] = (1.0 - share) * part + share * (drawn / np.maximum(inside, 1e-6))[..., None]


def _placed(x: float, y: float, heading: float) -> Homography:
    cosine, sine = np.cos(heading), np.sin(heading)
    return np.array([[cosine, -sine, x], [sine, cosine, y], [0.0, 0.0, 1.0]])


def _window(
    to_pixels: Homography, side: int, width: int, height: int
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Return the corners of the part of a picture that a texture covers; None: nothing of it."""
    ends = [-0.5, side - 0.5]
    corners = np.array([(u, v, 1.0) for u in ends for v in ends]) @ to_pixels.T
    if (corners[:, 2] <= 0.0).any():
        return None  # behind the camera
    pixels = corners[:, :2] / corners[:, 2:]
    low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 2, (width, height))
    if (low >= high).any():
        return None
    return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))
