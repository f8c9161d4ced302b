"""Corners of tags from their sides: a line through many places along each side's edge.

A corner alone is as exact as the few pixels about it. A side of 35 pixels is a line through as
many of them, so corners that are the ends of lines are several times as exact.
"""

from typing import Final

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

ALONG: Final = np.linspace(0.12, 0.88, 24)  # of a side, where its edge is looked for
SAMPLES: Final = 21  # across an edge
REACHES: Final = ((4.0, 0.11), (2.5, 0.07), (2.5, 0.07))
"""[px] to both sides of an edge, and at most so much of a side, in each round: a tag's black border
and the white one around it are an eighth of a side."""
FARTHEST: Final = 4.0  # [px], a corner that moves more is left as it was found

Quads = Float[ndarray, "M 4 2"]


def refine_corners(image: UInt8[ndarray, "height width"], corners: Quads) -> Quads:
    """Return the corners of M dark squares on white from the lines along their sides."""
    refined = corners
    for pixels, share in REACHES:
        sides = np.linalg.norm(np.roll(refined, -1, axis=1) - refined, axis=2)
        refined = _refined(image, refined, np.minimum(pixels, share * sides.min(axis=1)))
    moved = np.linalg.norm(refined - corners, axis=2).max(axis=1)
    kept = np.isfinite(moved) & (moved < FARTHEST)
    return np.where(kept[:, None, None], refined, corners)


def _refined(
    image: UInt8[ndarray, "height width"], corners: Quads, reach: Float[ndarray, "M"]
) -> Quads:
    """Return corners from edges that are no farther from the sides than a reach [px]."""
    ends = np.roll(corners, -1, axis=1)
    ways = ends - corners  # (M, 4, 2)
    lengths = np.linalg.norm(ways, axis=2)
    # Clockwise in the image, where y points down: outward is the way turned to its left.
    normals = np.stack([ways[..., 1], -ways[..., 0]], axis=-1) / lengths[..., None]
    places = corners[:, :, None] + ALONG[:, None] * ways[:, :, None]  # (M, 4, A, 2)
    offsets = reach[:, None] * np.linspace(-1.0, 1.0, SAMPLES)  # (M, C)
    sampled = (
        places[:, :, :, None] + offsets[:, None, None, :, None] * normals[:, :, None, None]
    )  # (M, 4, A, C, 2)
    x, y = sampled.astype(np.float32).reshape(len(sampled), -1, 2).transpose(2, 0, 1)
    values = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profiles = values.reshape(sampled.shape[:-1]).astype(np.float64)
    rises = np.maximum(np.diff(profiles, axis=-1), 0.0)
    middles = (offsets[:, 1:] + offsets[:, :-1])[:, None, None] / 2
    shifts = (rises * middles).sum(axis=-1) / np.maximum(rises.sum(axis=-1), 1e-9)  # (M, 4, A)
    edges = places + shifts[..., None] * normals[:, :, None]
    return _intersections(*_lines(edges))


def _lines(edges: Float[ndarray, "M 4 A 2"]) -> tuple[ndarray, ndarray]:
    """Return a point (M, 4, 2) and a direction (M, 4, 2) of the line nearest to places."""
    middle = edges.mean(axis=2)
    away = edges - middle[:, :, None]
    spread = np.einsum("msai,msaj->msij", away, away)
    return middle, np.linalg.eigh(spread)[1][..., 1]


def _intersections(points: ndarray, ways: ndarray) -> Quads:
    """Return the corners (M, 4, 2) where each line meets the one before it."""
    before, way = np.roll(points, 1, axis=1), np.roll(ways, 1, axis=1)
    cross = way[..., 0] * ways[..., 1] - way[..., 1] * ways[..., 0]
    gap = points - before
    share = (gap[..., 0] * ways[..., 1] - gap[..., 1] * ways[..., 0]) / np.where(
        np.abs(cross) > 1e-6, cross, np.nan
    )
    return np.asarray(before + share[..., None] * way)
