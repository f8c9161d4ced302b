"""Pushes of bodies, for the compiled kernels: tables of corners and of supports.

Everything is in the body's frame, in units of the state's radius, so that one table serves all
scenes. A disk is an outline of one corner, rounded by its radius; the tool likewise.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.push import LENGTH, LOCATION, SPEED, PushLimits, strokes
from sain_core.scene import POSITION
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import REGULAR_FEET, Shape, feet_places
from sain_core.shapes.solids import flat_bottom
from sain_core.types import Indices, Points, Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.thread_pool import even_blocks, run_blocks
from sain_model.physics.push_kernels import CHUNK, push_bodies_block

Touched = Bool[ndarray, "B N"]
Ways = Float[ndarray, "B 5"]  # start of the tool [m], heading [rad], way [m], speed [m/s]

STRAIGHT: Final = 1e-9  # [rad], a corner that turns less is a point in the middle of a side
SHARE, AREA = 2, 3  # columns of a support after its x and y


class BodyTable(NamedTuple):
    """N bodies with M corners and F supports in all; those of body i begin at `first[i]`.

    E = N + 1.
    """

    first_corner: Int[ndarray, "E"]
    corners: Float[ndarray, "M 2"]  # counter-clockwise
    first_support: Int[ndarray, "E"]
    supports: Float[ndarray, "F 4"]  # x, y, share of the load, area that it stands for
    rounding: Float[ndarray, "N"]  # 1 for a disk, 0 for an outline with straight sides
    reach: Float[ndarray, "N"]  # circumscribed radius
    inertia: Float[ndarray, "N"]  # upright moment, share of mass x radius^2
    fixed: Bool[ndarray, "N"]


def push_bodies(
    scenes: Scenes,
    ways: Ways,
    pushed: Indices,
    table: BodyTable,
    physics: ndarray,
    own: ndarray,
) -> tuple[Scenes, Touched]:
    """Simulate pushes.

    Args:
        scenes: (B, N, 8).
        ways: of the tool, as `tool_ways` makes them.
        pushed: which body each push is against, (B,).
        table: of the N bodies.
        physics: numbers of the pushes, (B,), as `rows_of` makes them.
        own: numbers of the bodies, (B, N), likewise.

    Returns:
        The settled scenes, and which bodies the tool touched (B, N).
    """
    order, after = nearest_first(scenes, pushed), plain(scenes.copy())
    touched = np.zeros(scenes.shape[:2], dtype=bool)
    size = even_blocks(len(scenes), CHUNK)

    def work(first: int) -> None:
        rows = slice(first, first + size)
        given = ways[rows], table, physics[rows], own[rows]
        push_bodies_block(0, after[rows], order[rows], *given, touched[rows])

    run_blocks(work, len(scenes), size)
    return after, touched


def tool_ways(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies, physics: ndarray
) -> Ways:
    """Return the ways of the tool, with the offsets of `physics` (B,), the numbers of the pushes.

    An offset of the location keeps the heading, and a stroke's start, which it states. A push of no
    length stays one, and none becomes shorter than that.
    """
    length = np.maximum(pushes[:, LENGTH] + physics["length_offset"], 0.0)
    length[pushes[:, LENGTH] == 0.0] = 0.0
    start, heading = strokes(scenes, pushes, limits, bodies)
    if physics["location_offset"].any():
        around = pushes.copy()
        around[:, LOCATION] += physics["location_offset"]
        start, _ = strokes(scenes, around, limits, bodies)
    start = start + np.column_stack([physics["tip_x"], physics["tip_y"]])
    heading = heading + physics["angle_offset"]
    return np.column_stack([start, heading, length, pushes[:, SPEED] * physics["speed_factor"]])


def nearest_first(scenes: Scenes, pushed: Indices) -> Int[ndarray, "B N"]:
    """Return the bodies by their distance from the pushed one, which is the first.

    The solver visits contacts one after another, which would let the numbering leak into the
    last digits. The order keeps it out.
    """
    middle = np.take_along_axis(scenes, pushed[:, None, None], axis=1)[..., POSITION]
    apart = ((scenes[..., POSITION] - middle) ** 2).sum(axis=-1)
    np.put_along_axis(apart, pushed[:, None], -1.0, axis=1)
    return np.argsort(apart, axis=1, kind="stable")


@lru_cache(maxsize=4096)  # a data set may have a thousand combinations of shapes
def body_table(bodies: Bodies) -> BodyTable:
    """Return the table of some bodies; made once, since a plan asks for it a dozen times."""
    corners = [_corners(shape) for shape in bodies.shapes]
    supports = [_flat(shape) if shape.lies_flat else _feet(shape) for shape in bodies.shapes]
    return BodyTable(
        _starts(corners),
        np.concatenate(corners),
        _starts(supports),
        np.concatenate(supports),
        np.array([float(shape.is_round) for shape in bodies.shapes]),
        np.array([shape.circumradius for shape in bodies.shapes]),
        np.array([shape.inertia(1.0, 1.0)[2] for shape in bodies.shapes]),
        np.array([body in bodies.fixed for body in range(len(bodies))]),
    )


def _corners(shape: Shape) -> Points:
    """Return the corners (M, 2) of an outline, without points in the middle of a side."""
    if shape.is_round:
        return np.zeros((1, 2))
    outline = shape.outline(1.0)
    here, after = outline - np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0) - outline
    cross = here[:, 0] * after[:, 1] - here[:, 1] * after[:, 0]
    turn = np.arctan2(cross, (here * after).sum(axis=1))
    return np.ascontiguousarray(outline[np.abs(turn) > STRAIGHT])


def _feet(shape: Shape) -> Float[ndarray, "3 4"]:
    """Return the three feet of a body; a round one that lies flat has them as well.

    There is one way to share a load among three, whatever they stand for.
    """
    feet = feet_places(REGULAR_FEET, 1.0) if shape.is_round else shape.supports(1.0)
    balance = np.column_stack([np.ones(3), feet]).T
    return np.column_stack([feet, np.linalg.solve(balance, [1.0, 0.0, 0.0]), np.ones(3)])


def _flat(shape: Shape) -> Float[ndarray, "F 4"]:
    points, shares = flat_bottom(shape)
    return np.column_stack([points, shares, shares])


def _starts(groups: Sequence[ndarray]) -> ndarray:
    return np.cumsum([0, *map(len, groups)])
