"""Ways of the tool's tip from place to place: along the table around bodies, or above them."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.csgraph import dijkstra

Tips = Float[ndarray, "T 3"]  # [m] in the world
Place = Float[ndarray, "2"]

SPACING: Final = 0.008  # [m] between points of a way
BEND: Final = np.linspace(0.0, 1.0, 17)[:, None]  # shares of a corner
NEAR: Final = 0.004  # [m], least gap between tool and bodies along the table
AWAY: Final = 0.010  # [m], gap at the corners of a way around a body
SMALLEST: Final = 0.002  # [m], detail of a body that a way around it follows


def line(start: ndarray, end: ndarray, spacing: float = SPACING) -> Tips:
    """Return points (T, 3) on a straight line, both ends included."""
    count = max(int(np.ceil(np.linalg.norm(end - start) / spacing)), 2)
    return np.asarray(start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start))


def rounded(corners: Float[ndarray, "M 3"], size: float) -> Tips:
    """Return points (T, 3) on the lines between corners (M, 3), which are rounded on the way.

    A corner becomes a parabola that leaves its lines at most a `size` [m] before and after it; two
    corners share the line between them.
    """
    moves = np.linalg.norm(np.diff(corners, axis=0), axis=1) > 1e-6
    if moves.sum() < 2:
        return line(corners[0], corners[-1])
    corners = np.concatenate([corners[:1], corners[1:][moves]])
    steps = np.diff(corners, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    room = lengths / 2.0
    room[[0, -1]] = lengths[[0, -1]]
    parts = [corners[:1]]
    ways = pairwise(steps / lengths[:, None])
    cuts = pairwise(np.minimum(room, size))
    for corner, (into, out), (before, after) in zip(corners[1:-1], ways, cuts, strict=True):
        first, end = corner - before * into, corner + after * out
        parts.append((1 - BEND) ** 2 * first + 2 * BEND * (1 - BEND) * corner + BEND**2 * end)
    fine = np.concatenate([*parts, corners[-1:]])
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    count = max(int(np.ceil(travel[-1] / SPACING)), 2)  # evenly: noise of points bends a way
    even = np.linspace(0.0, travel[-1], count + 1)
    return np.stack([np.interp(even, travel, axis) for axis in fine.T], axis=-1)


def above(start: ndarray, end: ndarray, height: float, base: Place, size: float) -> Tips:
    """Return a way (T, 3) straight up to a height [m], across, and straight down, rounded.

    Across is a spiral about the base, which comes no nearer than its ends.
    """
    radii = [float(np.hypot(*(place[:2] - base))) for place in (start, end)]
    most = max(radii)
    corners = [
        np.array([radius, most * np.arctan2(*(place[:2] - base)[::-1]), z])
        for radius, place in zip(radii, (start, end), strict=True)
        for z in (place[2], max(place[2], height))
    ]
    corners[2:] = corners[:1:-1]
    radius, along, z = rounded(np.array(corners), size).T
    x, y = base[0] + radius * np.cos(along / most), base[1] + radius * np.sin(along / most)
    return np.stack([x, y, z], axis=-1)


def around(
    start: Place,
    end: Place,
    bodies: Sequence[ndarray],
    radius: float,
    within: Float[ndarray, "2 2"],
) -> Float[ndarray, "M 2"] | None:
    """Return the corners (M, 2) of the shortest way of a tool between bodies, or None.

    The way goes by corners of the bodies' hulls, grown by tool and gap: a visibility graph. At its
    ends the tool may be nearer to a body, as after a stroke.

    Args:
        start: where the tool is [m].
        end: where it goes.
        bodies: their outlines (M, 2) [m].
        radius: of the tool [m].
        within: lowest and highest x, y [m].
    """
    from shapely import MultiPoint, Polygon, intersects, linestrings, prepare, union_all

    rings, ends = [Polygon(outline) for outline in bodies], np.stack([start, end])
    closed = union_all([ring.buffer(radius + NEAR) for ring in rings])
    closed = closed.difference(MultiPoint(ends).buffer(AWAY))
    prepare(closed)
    if not intersects(closed, linestrings(ends)):
        return ends
    hulls = [
        ring.convex_hull.buffer(radius + AWAY, quad_segs=2).simplify(SMALLEST) for ring in rings
    ]
    corners = np.concatenate([np.array(hull.exterior.coords)[:-1] for hull in hulls])
    inside = ((corners >= within[:, 0]) & (corners <= within[:, 1])).all(axis=1)
    places = np.concatenate([ends, corners[inside]])
    first, second = np.triu_indices(len(places), 1)
    lines = linestrings(np.stack([places[first], places[second]], axis=1))
    free = ~intersects(closed, lines)
    lengths = np.zeros((len(places), len(places)))
    apart = np.linalg.norm(places[second] - places[first], axis=1)
    lengths[first[free], second[free]] = apart[free]
    length, before = dijkstra(lengths, directed=False, indices=0, return_predecessors=True)
    if not np.isfinite(length[1]):
        return None
    way = [1]
    while way[-1] != 0:
        way.append(int(before[way[-1]]))
    return np.asarray(places[way[::-1]])
