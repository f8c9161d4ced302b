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

from sain_core.push import LENGTH, PushLimits, pushed_bodies, strokes
from sain_core.scene import POSITION
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import REGULAR_FEET, Shape, feet_places
from sain_core.shapes.supports import FEET, FLAT, flat_bottom
from sain_core.types import Indices, Points, Pushes, Scalars, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.thread_pool import even_blocks, run_blocks
from sain_model.physics.body_kernels import Physics
from sain_model.physics.corrections import (
    ANGLE,
    OF_DISKS,
    Corrections,
    corrected_disks,
    corrected_pushes,
    saturated,
)
from sain_model.physics.push_kernels import CHUNK, push_bodies_block

Touched = Bool[ndarray, "B N"]
Ways = Float[ndarray, "B 4"]  # where the tool starts [m], its heading [rad], its way [m]

STRAIGHT: Final = 1e-9  # [rad], a corner that turns less is a point in the middle of a side
SHARE, ALONG_X, ALONG_Y = 2, 3, 4  # columns of a support after its x and y


class BodyTable(NamedTuple):
    """N bodies with M corners and F supports in all; those of body i begin at `first[i]`.

    E = N + 1.
    """

    first_corner: Int[ndarray, "E"]
    corners: Float[ndarray, "M 2"]  # counter-clockwise
    first_support: Int[ndarray, "E"]
    supports: Float[ndarray, "F 5"]  # x, y, share of the load, and how it grows along x and y
    rounding: Float[ndarray, "N"]  # 1 for a disk, 0 for an outline with straight sides
    reach: Float[ndarray, "N"]  # circumscribed radius
    inertia: Float[ndarray, "N"]  # upright moment, share of mass x radius^2
    fixed: Bool[ndarray, "N"]


def push_bodies(
    scenes: Scenes,
    ways: Ways,
    pushed: Indices,
    friction: Scalars,
    table: BodyTable,
    physics: Physics,
    corrections: Corrections | None = None,
) -> tuple[Scenes, Touched]:
    """Simulate pushes.

    Args:
        scenes: (B, N, 8).
        ways: of the tool, as `tool_ways` makes them.
        pushed: which body each push is against, (B,).
        friction: with the table, (B,).
        table: of the N bodies.
        physics: the rest.
        corrections: of each body; None: there are none.

    Returns:
        The settled scenes, and which bodies the tool touched (B, N).
    """
    told = np.empty((len(scenes), 0, OF_DISKS))
    if corrections is not None:
        told = plain(corrected_disks(corrections))
    order, after = nearest_first(scenes, pushed), plain(scenes.copy())
    touched = np.zeros(scenes.shape[:2], dtype=bool)
    friction, size = plain(friction), even_blocks(len(scenes), CHUNK)

    def work(first: int) -> None:
        rows = slice(first, first + size)
        known = ways[rows], friction[rows], table, physics
        push_bodies_block(0, after[rows], order[rows], *known, touched[rows], told[rows])

    run_blocks(work, len(scenes), size)
    return after, touched


def tool_ways(
    scenes: Scenes,
    pushes: Pushes,
    limits: PushLimits,
    bodies: Bodies,
    corrections: Corrections | None = None,
) -> Ways:
    """Return where the tool's axis starts, its heading and how far it goes, as corrected.

    A corrected location keeps the heading.
    """
    start, heading = strokes(scenes, pushes, limits, bodies)
    if corrections is None:
        return np.column_stack([start, heading, pushes[:, LENGTH]])
    corrected = corrected_pushes(pushes, corrections)
    start, _ = strokes(scenes, corrected, limits, bodies)
    told = saturated(corrections)[np.arange(len(pushes)), pushed_bodies(pushes)]
    return np.column_stack([start, heading + told[:, ANGLE], corrected[:, LENGTH]])


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
def body_table(bodies: Bodies, bottom: str = FEET, pressure: float = 0.0) -> BodyTable:
    """Return the table of some bodies; made once, since a plan asks for it a dozen times.

    `bottom` is `FEET` or `FLAT`, `pressure` how a flat one presses (`flat_bottom`).
    """
    corners = [_corners(shape) for shape in bodies.shapes]
    if bottom == FLAT:
        supports = [load_shares(*flat_bottom(shape, pressure)) for shape in bodies.shapes]
    else:
        supports = [load_shares(_feet(shape)) for shape in bodies.shapes]
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


def load_shares(
    supports: Points, weights: Float[ndarray, "F"] | None = None
) -> Float[ndarray, "F 5"]:
    """Return supports (F, 2) with how they share the load of a body whose weight acts at p.

    Statics asks that the shares sum to 1 and balance at p: A w = (1, p_x, p_y). Three supports
    leave one answer, the barycentric coordinates of p; of more, the least norm is taken, as by
    supports that are as stiff as their weights (F,) say; None: equally stiff.

    Returns:
        (F, 5): x, y, the share at p = 0, and its derivatives by p_x and p_y.
    """
    root = np.ones(len(supports)) if weights is None else np.sqrt(weights)
    balance = np.column_stack([np.ones(len(supports)), supports]).T
    return np.column_stack([supports, root[:, None] * np.linalg.pinv(balance * root)])


def _corners(shape: Shape) -> Points:
    """Return the corners (M, 2) of an outline, without points in the middle of a side."""
    if shape.is_round:
        return np.zeros((1, 2))
    outline = shape.outline(1.0)
    here, after = outline - np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0) - outline
    cross = here[:, 0] * after[:, 1] - here[:, 1] * after[:, 0]
    turn = np.arctan2(cross, (here * after).sum(axis=1))
    return np.ascontiguousarray(outline[np.abs(turn) > STRAIGHT])


def _feet(shape: Shape) -> Points:
    """Return the three feet (3, 2) of a body; a round one that lies flat has them as well."""
    if shape.is_round:
        return feet_places(REGULAR_FEET, 1.0)
    return shape.supports(1.0)


def _starts(groups: Sequence[ndarray]) -> ndarray:
    return np.cumsum([0, *map(len, groups)])
