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
    START,
    STROKE_SIZE,
    TIP_RADIUS,
    PushLimits,
    is_stroke,
    strokes,
    tip_radii,
)
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Angles, Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.threads import run_blocks
from sain_model.network.feature_kernels import (
    BODY_FEATURES,
    LANES,
    MIRRORED_BODY,
    PLACE_FEATURES,
    RELATION_FEATURES,
    OutlineTable,
    write_block,
)
from sain_model.network.settings import WORLD_FRAME, NetworkConfig
from sain_model.physics.parameters import BY_NAME, Values
from sain_model.physics.planar import body_table, first_touch

FACTORS: Final = {"tool_friction": 0.2, "torsion": 1.0}  # by name, where their logarithm is 0
LEAST: Final = 0.05  # share of that: a friction may be 0, and has no logarithm there
NUMBERS: Final = ("pressure",)
OF_BODY, OF_TABLE = 1.0, 0.0  # what turns with the body, and what with the world
VECTORS: Final = (  # x and y, in whose frame, and how often they turn when the frame turns once
    ("centre_x", "centre_y", OF_BODY, 1.0),
    ("grain_x", "grain_y", OF_BODY, 2.0),
    ("table_grain_x", "table_grain_y", OF_TABLE, 2.0),
    ("tip_x", "tip_y", OF_TABLE, 1.0),
)
SCALES: Final = {"pressure": 1.0}  # by name; else the spread of the parameter
BELIEVED_FEATURES: Final = len(FACTORS) + len(NUMBERS) + 2 * len(VECTORS)
MIRRORED_BELIEVED: Final = tuple(  # columns that change their sign in a mirror
    len(FACTORS) + len(NUMBERS) + 2 * number + 1 for number in range(len(VECTORS))
)


def network_beliefs(
    config: NetworkConfig, scenes: Scenes, frames: Float[ndarray, "B S"], values: Values
) -> Float[ndarray, "B N P"]:
    """Return what a network sees of what is believed of each body's physics, of order one.

    That is nothing, unless it was made to see it. `frames` are those of the pushes, as
    `push_frames` makes them; values (B,) or (B, N) that are missing are 0 here.
    """
    if not config.believed:
        return np.empty((*scenes.shape[:2], 0))
    columns = [
        np.log(_value(scenes, values, name, middle) / middle) / _scale(name)
        for name, middle in FACTORS.items()
    ]
    columns += [_value(scenes, values, name, 0.0) / _scale(name) for name in NUMBERS]
    for name_x, name_y, of_body, times in VECTORS:
        x, y = (_value(scenes, values, name, 0.0) / _scale(name) for name in (name_x, name_y))
        angle = times * (of_body * scenes[..., THETA] - frames[:, LOCATION, None])
        cos, sin = np.cos(angle), np.sin(angle)
        columns += [cos * x - sin * y, sin * x + cos * y]
    return np.stack(columns, axis=-1)


def _value(scenes: Scenes, values: Values, name: str, default: float) -> Float[ndarray, "B N"]:
    value = values.get(name, np.asarray(default))
    value = np.broadcast_to(value[:, None] if value.ndim == 1 else value, scenes.shape[:2])
    return np.maximum(value, LEAST * default) if name in FACTORS else value


def _scale(name: str) -> float:
    return SCALES.get(name, BY_NAME[name].spread)


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
    last = table.first_corner[-1:] + 1
    loads = [
        _load_moments(table.supports[first:end], reach)
        for first, end, reach in zip(
            table.first_support, table.first_support[1:], table.reach, strict=False
        )
    ]
    return OutlineTable(
        np.concatenate([table.first_corner, last]),
        np.concatenate([table.corners, np.zeros((1, 2))]),
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
    rows[:, TIP_RADIUS] = tip_radii(pushes, LIMITS)
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
    believed = network_beliefs(config, scenes, frames, values or {})
    places = config.features == WORLD_FRAME
    table = outline_table(bodies.fitted(count))
    of_body, of_relation = count_features(config)
    features = np.zeros((batch, count, of_body - believed.shape[-1]), np.float32)
    relations = np.zeros((batch, count * count, of_relation), np.float32)
    rows = plain(scenes), plain(frames), plain(physics_next)

    def work(first: int) -> None:
        write_block(first, *rows, table, places, features, relations)

    run_blocks(work, batch, LANES)
    return Features(np.concatenate([features, believed.astype(np.float32)], axis=-1), relations)


def true_residual(next_scenes: Scenes, frames: Strokes, physics_next: Scenes) -> Residual:
    """Return the residual that makes the prediction right."""
    missing = next_scenes[..., POSITION] - physics_next[..., POSITION]
    turned = wrap_angle(next_scenes[..., THETA] - physics_next[..., THETA])
    return np.concatenate([turn(missing, -frames[:, LOCATION]), turned[..., None]], axis=-1)


def turn(vectors: Float[ndarray, "B N 2"], angle: Angles) -> Float[ndarray, "B N 2"]:
    """Return vectors turned by an angle (B,) [rad] each."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
