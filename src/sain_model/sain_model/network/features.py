"""Inputs and residuals of batches of pushes, with NumPy: what a network is trained on.

`network.feature_kernels` says what the features are. What is believed of the physics is seen in the
frame of the push, too: a body's centre of mass, the grain of friction and the offset of the tool
turn with the scene, and in a mirror those across the push change their sign.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import (
    ANGLE,
    LOCATION,
    PUSH_SIZE,
    SPAN_X,
    START,
    STROKE_SIZE,
    TIP_RADIUS,
    PushLimits,
    is_stroke,
    second_disks,
    strokes,
    tip_radii,
)
from sain_core.scene import POSITION, THETA, turned, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.threads import run_blocks
from sain_model.network.feature_kernels import (
    BODY_FEATURES,
    LANES,
    MIRRORED_BODY,
    PLACE_FEATURES,
    RELATION_FEATURES,
    VECTORS_FROM,
    OutlineTable,
    write_block,
)
from sain_model.network.settings import WORLD_FRAME, NetworkConfig
from sain_model.physics.parameters import BY_NAME, Values
from sain_model.physics.planar import body_table, first_touch

FACTORS: Final = {"tool_friction": 0.2, "torsion": 1.0}  # by name, where their logarithm is 0
LEAST: Final = 0.05  # share of that: a friction may be 0, and has no logarithm there
NUMBERS: Final = ("pressure",)
VECTORS: Final = (  # x and y of each, in the order in which the kernels turn them
    "centre_x", "centre_y", "grain_x", "grain_y", "table_grain_x", "table_grain_y", "tip_x", "tip_y"
)  # fmt: skip
SCALES: Final = {"pressure": 1.0}  # by name; else the spread of the parameter
SEEN: Final = (*FACTORS, *NUMBERS, *VECTORS)
BELIEVED_FEATURES: Final = len(SEEN)
# Columns that change their sign in a mirror.
MIRRORED_BELIEVED: Final = tuple(range(VECTORS_FROM + 1, BELIEVED_FEATURES, 2))


def network_beliefs(config: NetworkConfig, values: Values, bodies: int) -> Float[ndarray, "R N P"]:
    """Return what a network sees of what is believed of each body's physics, of order one.

    That is nothing, unless it was made to see it. Values (R,) or (R, N) that are missing are 0
    here. The kernels turn vectors into the push frame.
    """
    if not config.believed:
        return np.empty((1, bodies, 0))
    rows = max((len(values[name]) for name in SEEN if name in values), default=1)
    believed = np.zeros((rows, bodies, len(SEEN)))
    for column, name in enumerate(SEEN):
        if name in values:
            value = values[name]
            if name in FACTORS:
                value = np.log(np.maximum(value, LEAST * FACTORS[name]) / FACTORS[name])
            scale = SCALES.get(name, BY_NAME[name].spread)
            believed[..., column] = (value[:, None] if value.ndim == 1 else value) / scale
    return believed


Strokes = Float[ndarray, "B S"]
Residual = Float[ndarray, "B N 3"]  # dx, dy [m] along the push frame's axes, dtheta [rad]
LIMITS = PushLimits()


class Features(NamedTuple):
    """Network inputs of B pushes."""

    bodies: Float[ndarray, "B N D"]  # what each body is and how physics moves it
    relations: Float[ndarray, "B E R"]  # how each ordered pair stands, before the push and after


def count_features(config: NetworkConfig) -> tuple[int, int]:
    """Return how many features each body and each relation has."""
    places = PLACE_FEATURES if config.features == WORLD_FRAME else 0
    believed = BELIEVED_FEATURES if config.believed else 0
    return BODY_FEATURES + places + believed, RELATION_FEATURES


def mirrored_columns(config: NetworkConfig) -> tuple[int, ...]:
    """Return the features of a body that change their sign in a mirror; none of the world's."""
    if not config.believed:
        return MIRRORED_BODY
    return MIRRORED_BODY + tuple(BODY_FEATURES + column for column in MIRRORED_BELIEVED)


@lru_cache(maxsize=256)
def outline_table(bodies: Bodies) -> OutlineTable:
    """Return what the kernels need of bodies and of the tool."""
    table = body_table(bodies)
    first = [np.append(table.first_corner, table.first_corner[-1] + disks) for disks in (1, 2)]
    loads = [
        _load_moments(table.supports[first:end], reach)
        for first, end, reach in zip(
            table.first_support, table.first_support[1:], table.reach, strict=False
        )
    ]
    return OutlineTable(
        np.array(first),
        np.concatenate([table.corners, np.zeros((2, 2))]),
        np.append(table.rounding, 1.0),
        np.append(table.reach, 1.0),
        np.append(table.inertia / table.reach**2, 0.0),
        np.array(loads),
    )


def _load_moments(supports: Float[ndarray, "F C"], reach: float) -> Float[ndarray, "6"]:
    """Return sums over supports of share x (r^2, r^2 e^{2i phi}, r^3 e^{3i phi}), and their count.

    In units of the circumscribed radius. They do not depend on the order of the supports.
    """
    place = (supports[:, 0] + 1j * supports[:, 1]) / reach
    share = supports[:, 2]
    second, third = share @ place**2, share @ place**3
    spread = float(share @ np.abs(place) ** 2)
    return np.array([spread, second.real, second.imag, third.real, third.imag, len(share)])


def elongations(bodies: Bodies) -> Float[ndarray, "N"]:
    """Return how near the supports of each body are to one line: 0 for a disk's feet, at most 1."""
    spread, second_x, second_y = outline_table(bodies).supports.T[:3]
    return np.asarray(np.hypot(second_x, second_y) / spread)


def push_frames(scenes: Scenes, pushes: Pushes, bodies: Bodies) -> Strokes:
    """Return pushes as features and residuals take them: `LOCATION` is the frame's heading.

    That of a push is the normal where it is located; that of a stroke the normal where its tool
    will first touch the pushed body, or the way of one that misses. See `network.feature_kernels`.
    """
    known = bodies.fitted(scenes.shape[1])
    start, heading = strokes(scenes, pushes, LIMITS, known)
    rows = np.zeros((len(pushes), STROKE_SIZE))
    rows[:, :PUSH_SIZE], rows[:, START] = pushes[:, :PUSH_SIZE], start
    rows[:, TIP_RADIUS], rows[:, SPAN_X:] = tip_radii(pushes, LIMITS), second_disks(pushes)
    if is_stroke(pushes):
        rows[:, LOCATION] = first_touch(scenes, pushes, known).normal
        rows[:, ANGLE] = wrap_angle(heading - rows[:, LOCATION])
    else:
        rows[:, LOCATION] = wrap_angle(heading - pushes[:, ANGLE])
    return rows


def network_inputs(
    config: NetworkConfig,
    scenes: Scenes,
    frames: Strokes,
    physics_next: Scenes,
    bodies: Bodies,
    values: Values | None = None,
) -> Features:
    """Return the inputs of a network for pushes in the frames that `push_frames` makes.

    `physics_next` is the prior's prediction, `values` are what is believed of the physics.
    """
    batch, count, _ = scenes.shape
    believed = network_beliefs(config, values or {}, count)
    places = config.features == WORLD_FRAME
    table = outline_table(bodies.fitted(count))
    of_body, of_relation = count_features(config)
    features = np.zeros((batch, count, of_body), np.float32)
    relations = np.zeros((batch, count * count, of_relation), np.float32)
    rows = plain(scenes), plain(frames), plain(physics_next), plain(believed)

    def work(first: int) -> None:
        write_block(first, *rows, table, places, features, relations)

    run_blocks(work, batch, LANES)
    return Features(features, relations)


def true_residual(next_scenes: Scenes, frames: Strokes, physics_next: Scenes) -> Residual:
    """Return the residual that makes the prediction right."""
    missing = next_scenes[..., POSITION] - physics_next[..., POSITION]
    turn = wrap_angle(next_scenes[..., THETA] - physics_next[..., THETA])
    return np.concatenate([turned(missing, -frames[:, LOCATION, None]), turn[..., None]], axis=-1)
