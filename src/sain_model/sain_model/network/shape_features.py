"""Inputs of networks for bodies of any shape, and of networks for disks by the same call."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import ANGLE, BODY, LENGTH, LOCATION, PUSH_SIZE, PushLimits, strokes
from sain_core.scene import wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.thread_pool import run_blocks
from sain_model.network.feature_kernels import LANES, PLACE_FEATURES
from sain_model.network.features import Features, make_features
from sain_model.network.patch_kernels import OutlineTable
from sain_model.network.settings import ANY_SHAPE, WORLD_FRAME, NetworkConfig
from sain_model.network.shape_feature_kernels import (
    PUSHED,
    SHAPE_BODY_FEATURES,
    START_X,
    STROKE_SIZE,
    write_shape_block,
)
from sain_model.network.shape_relation_kernels import SHAPE_RELATION_FEATURES
from sain_model.physics.outlines import body_table

Strokes = Float[ndarray, "B S"]
LIMITS = PushLimits()


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
        LIMITS.tool_radius,
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


def push_frames(config: NetworkConfig, scenes: Scenes, pushes: Pushes, bodies: Bodies) -> Strokes:
    """Return pushes as features and residuals take them: the frame's heading is the first column.

    A network for disks takes pushes as they are; one for any shape takes them as
    `network.shape_feature_kernels` has them.
    """
    if config.bodies != ANY_SHAPE:
        return pushes
    known = bodies.fitted(scenes.shape[1])
    start, heading = strokes(scenes, pushes, LIMITS, known)
    rows = np.zeros((len(pushes), STROKE_SIZE))
    rows[:, LOCATION] = wrap_angle(heading - pushes[:, ANGLE])
    rows[:, ANGLE], rows[:, LENGTH] = pushes[:, ANGLE], pushes[:, LENGTH]
    rows[:, START_X : START_X + 2] = start
    if pushes.shape[1] > PUSH_SIZE:
        rows[:, PUSHED] = pushes[:, BODY]
    return rows


def network_inputs(
    config: NetworkConfig,
    scenes: Scenes,
    frames: Strokes,
    physics_next: Scenes,
    bodies: Bodies,
) -> Features:
    """Return the inputs of a network of this kind.

    Args:
        config: of the network.
        scenes: before the pushes.
        frames: of the pushes, as `push_frames` makes them.
        physics_next: the prior's prediction.
        bodies: of the scenes.
    """
    if config.bodies != ANY_SHAPE:
        return make_features(scenes, frames, physics_next, config.features)
    batch, count, _ = scenes.shape
    places = config.features == WORLD_FRAME
    table = outline_table(bodies.fitted(count))
    width = SHAPE_BODY_FEATURES + (PLACE_FEATURES if places else 0)
    features = np.zeros((batch, count, width), np.float32)
    relations = np.zeros((batch, count * count, SHAPE_RELATION_FEATURES), np.float32)
    rows = plain(scenes), plain(frames), plain(physics_next)

    def work(first: int) -> None:
        write_shape_block(first, *rows, table, places, features, relations)

    run_blocks(work, batch, LANES)
    return Features(features, relations)
