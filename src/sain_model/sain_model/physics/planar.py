"""The planar prior: a batched contact simulator of bodies on a table, without an arm.

It is the fast f_p of the paper's equation 2 that can sit inside every rollout. It believes the
mass and radius that the scene states and, unless told better, the nominal friction. Tables of
bodies are in the body's frame, in units of the state's radius, so that one serves all scenes. A
disk is an outline of one corner, rounded by its radius; the tool likewise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, NamedTuple, Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.errors import InvalidInputError
from sain_core.model import IdentityPrior, Model, answering, check_step
from sain_core.push import (
    LENGTH,
    LOCATION,
    SPEED,
    PushLimits,
    is_stroke,
    pushed_bodies,
    second_disks,
    strokes,
    tip_radii,
)
from sain_core.scene import OVERLAP_TOLERANCE
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import REGULAR_FEET, Shape, feet_places
from sain_core.shapes.solids import flat_bottom
from sain_core.types import Angles, Indices, Mask, Points, Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.kernel_store import compile_visibly
from sain_model.compute.threads import even_blocks, run_blocks
from sain_model.physics.contact_kernels import (
    DISTANCE,
    GAP,
    GAP_BODY,
    NORMAL,
    TOUCH_SIZE,
    find_touches,
)
from sain_model.physics.parameters import (
    HARMONICS,
    PlanarConfig,
    Values,
    check_batch,
    check_values,
    rows_of,
)
from sain_model.physics.push_kernels import CHUNK, push_bodies_block

# start of the tool [m], heading [rad], way [m], speed [m/s], and its second disk
Ways = Float[ndarray, "B 8"]

SHARE: Final = 2  # column of a support, after its x and y
WAVES: Final = {"cos": np.cos, "sin": np.sin}
STRAIGHT: Final = 1e-9  # [rad], a corner that turns less is a point in the middle of a side


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


class Simulation(NamedTuple):
    """Pushes that are ready to be simulated, a block of them after the other."""

    scenes: Scenes  # (B, N, 8), changed to the settled ones
    pushed: Indices
    ways: Ways  # as `tool_ways` makes them
    table: BodyTable
    physics: ndarray  # (R,), as `rows_of` makes them
    own: ndarray  # (R, N), likewise

    def run(self, first: int, last: int) -> None:
        """Simulate those from number `first` to before `last`; there may be fewer."""
        push_bodies_block(first, last, *self)


def tool_ways(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies, physics: ndarray
) -> Ways:
    """Return the ways of the tool, with the offsets of `physics` (R,), the numbers of the pushes.

    That of the tip is left to the kernel. Any other is a mean, and harmonics of the heading in the
    world: a robot is not equally exact in all directions. That of the location keeps the heading,
    and a stroke's start, which it states. A push of no length stays one, and none becomes shorter
    than that.
    """
    start, heading = strokes(scenes, pushes, limits, bodies)
    further, left, around = (
        _offset(physics, name, heading)
        for name in ("length_offset", "angle_offset", "location_offset")
    )
    length = np.maximum(pushes[:, LENGTH] + further, 0.0)
    length[pushes[:, LENGTH] == 0.0] = 0.0
    if around.any():
        moved = pushes.copy()
        moved[:, LOCATION] += around
        start, _ = strokes(scenes, moved, limits, bodies)
    speed = pushes[:, SPEED] * physics["speed_factor"]
    return np.column_stack([start, heading + left, length, speed, second_disks(pushes)])


def _offset(physics: ndarray, name: str, heading: Angles) -> Float[ndarray, "B"]:
    """Return an offset of the tool at headings (B,): a mean, and harmonics of the heading."""
    total = physics[name]
    for wave, order in HARMONICS:
        height = physics[f"{name}_{wave}{order}"]
        if height.any():
            total = total + height * WAVES[wave](order * heading)
    return total


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


@dataclass(frozen=True, eq=False)
class FirstTouch:
    """Of each of B strokes."""

    # between the tool and the nearest body before the stroke [m]; negative: they overlap
    gap: Float[ndarray, "B"]
    nearest: Indices  # which body that is
    # of travel until the tool touches the body that is pushed [m]; infinite: it misses
    distance: Float[ndarray, "B"]
    # heading of that body's inward normal there [rad]; of a miss that of travel
    normal: Float[ndarray, "B"]

    @property
    def inside(self) -> Mask:
        """Which strokes begin inside a body: by more than a scene may be measured wrongly."""
        return np.asarray(self.gap < -OVERLAP_TOLERANCE)


def first_touch(scenes: Scenes, strokes: Pushes, bodies: Bodies) -> FirstTouch:
    """Return where strokes (B, 11) in scenes (B, N, 8) begin and first touch."""
    touches = np.zeros((len(scenes), TOUCH_SIZE))
    table = body_table(bodies.fitted(scenes.shape[1]))
    find_touches(plain(scenes), plain(strokes), table, touches)
    gap, distance, normal = touches[:, GAP], touches[:, DISTANCE], touches[:, NORMAL]
    return FirstTouch(gap, touches[:, GAP_BODY].astype(np.int64), distance, normal)


def check_starts(scenes: Scenes, strokes: Pushes, bodies: Bodies) -> None:
    """Check that no stroke (B, 11) that moves begins with the tool inside a body.

    An overlap of up to `OVERLAP_TOLERANCE` is taken as touching: poses are measured.
    Raises `InvalidInputError`: naming the first that does.
    """
    touch = first_touch(scenes, strokes, bodies)
    wrong = touch.inside & (strokes[:, LENGTH] > 0.0)
    if wrong.any():
        index = int(np.argmax(wrong))
        raise InvalidInputError(
            f"stroke {index} begins with the tool {-1e3 * touch.gap[index]:.2f} mm inside body"
            f" {touch.nearest[index]}; it must begin outside of all bodies (overlaps up to"
            f" {1e3 * OVERLAP_TOLERANCE:g} mm are taken as touching)"
        )


@dataclass(frozen=True)
class PlanarPrior(Model):
    """Predicts pushes by simulating them in the plane."""

    config: PlanarConfig = PlanarConfig()
    bodies: Bodies = PAPER_DISKS  # that are pushed
    each: tuple[PlanarConfig, ...] = ()  # physics of the first bodies, where they differ

    def __post_init__(self) -> None:
        """See that the kernels are compiled: no plan is to wait for them."""
        compile_visibly()

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return this prior for scenes of these bodies."""
        return self if bodies == self.bodies else replace(self, bodies=bodies)

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes from scenes (B, N, 8) at rest.

        Each scene has one push (B, 5) or stroke (B, 11). Length 0 leaves it unchanged, bit for bit.
        `values` are of parameters by name (`sain_model.physics.parameters`), (B,); those of bodies
        (B,) or (B, N). The settings have the others.

        Raises `InvalidInputError`: wrong shapes, NaN or Inf, a value that is not allowed, or a
        stroke that begins inside a body; `OutOfRangeError`: a push that no model may be asked
        about.
        """
        simulation, size = self.simulation(scenes, pushes, values), even_blocks(len(scenes), CHUNK)
        run_blocks(lambda first: simulation.run(first, first + size), len(scenes), size)
        return simulation.scenes

    def simulation(
        self, scenes: Scenes, pushes: Pushes, values: Values | None = None
    ) -> Simulation:
        """Return what `step` simulates, which raises the same."""
        check_batch(scenes, pushes, self.bodies)
        values = values or {}
        batch, count, _ = scenes.shape
        check_values(values, batch, count)
        config, bodies = self.config, self.bodies.fitted(count)
        rows = batch if values or is_stroke(pushes) else 1  # one row is for all
        physics, own = rows_of(config, self.each, values, rows, count)
        limits = _limits(config.tool_radius, config.clearance)
        if is_stroke(pushes):
            check_starts(scenes, pushes, bodies)
            physics["tool_radius"] = tip_radii(pushes, limits)
        ways = tool_ways(scenes, pushes, limits, bodies, physics)
        pushed, table = pushed_bodies(pushes), body_table(bodies)
        return Simulation(plain(scenes.copy()), pushed, ways, table, physics, own)


@lru_cache
def _limits(tool_radius: float, clearance: float) -> PushLimits:
    """Return the limits of a tool; kept, since checking them takes as long as some pushes."""
    return PushLimits(tool_radius=tool_radius, clearance=clearance)


def step_knowing(prior: Model, scenes: Scenes, pushes: Pushes, values: Values | None) -> Scenes:
    """Predict with a prior that is given values of parameters, if it has any."""
    if isinstance(prior, PlanarPrior):
        return prior.step(scenes, pushes, values)
    if isinstance(prior, IdentityPrior):
        return prior.step(scenes, pushes)
    with answering("the prior"):
        return check_step(prior.step(scenes, pushes), scenes, "the prior")
