"""Batches of pushes in which each row has parameters of its own."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, PushLimits, pushed_bodies, strokes
from sain_core.scene import RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.batch_checks import check_batch
from sain_model.compute.compiling import plain
from sain_model.compute.thread_pool import run_blocks
from sain_model.identification.varied_kernels import push_varied_block, push_varied_bodies_block
from sain_model.physics.corrections import OF_DISKS
from sain_model.physics.outlines import body_table, nearest_first
from sain_model.physics.planar import disks_first, takes_disks
from sain_model.physics.planar_config import PlanarConfig
from sain_model.physics.planar_kernels import CHUNK

PhysicsRows = Float[ndarray, "B 20"]  # the numbers of a `Physics` for each push


def step_varied(
    config: PlanarConfig,
    bodies: Bodies,
    scenes: Scenes,
    pushes: Pushes,
    friction: Scalars,
    physics: PhysicsRows,
) -> Scenes:
    """Predict pushes as `PlanarPrior.step` does, each with its own friction and parameters.

    Args:
        config: for the tool's radius and where it starts.
        bodies: of all scenes.
        scenes: (B, N, 8).
        pushes: (B, 3) or (B, 4).
        friction: with the table, (B,).
        physics: (B, 20).

    Raises:
        InvalidInputError: arrays that do not fit together.
    """
    check_batch(scenes, pushes, friction, bodies)
    if takes_disks(bodies):
        return _step_disks(config, scenes, pushes, friction, physics)
    limits = PushLimits(tool_radius=config.tool_radius, clearance=config.clearance)
    start, heading = strokes(scenes, pushes, limits, bodies)
    ways = np.column_stack([start, heading, pushes[:, LENGTH]])
    after, order = plain(scenes.copy()), nearest_first(scenes, pushed_bodies(pushes))
    touched, none = np.zeros(scenes.shape[:2], dtype=bool), np.empty((len(scenes), 0, OF_DISKS))
    rows = after, order, ways, plain(friction), body_table(bodies), plain(physics), touched, none
    run_blocks(lambda first: push_varied_bodies_block(first, *rows), len(scenes), CHUNK)
    return after


def _step_disks(
    config: PlanarConfig, scenes: Scenes, pushes: Pushes, friction: Scalars, physics: PhysicsRows
) -> Scenes:
    pushed = pushed_bodies(pushes)
    order = disks_first(scenes, pushed)
    after = np.ascontiguousarray(np.take_along_axis(scenes, order, axis=1))
    start = scenes[np.arange(len(scenes)), pushed, RADIUS] + config.tool_radius + config.clearance
    touched = np.zeros(scenes.shape[:2], dtype=bool)
    rows = after, plain(pushes), plain(friction), start, plain(physics), touched
    run_blocks(lambda first: push_varied_block(first, *rows), len(scenes), CHUNK)
    predicted = np.empty_like(after)
    np.put_along_axis(predicted, order, after, axis=1)
    return predicted
