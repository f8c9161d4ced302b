"""Batches of pushes in which each row has parameters of its own."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import PushLimits, pushed_bodies
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.batch_checks import check_batch
from sain_model.compute.compiling import plain
from sain_model.compute.thread_pool import run_blocks
from sain_model.identification.varied_kernels import push_varied_block
from sain_model.physics.body_table import body_table, nearest_first, tool_ways
from sain_model.physics.corrections import OF_DISKS
from sain_model.physics.planar_config import PlanarConfig
from sain_model.physics.push_kernels import CHUNK

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
        pushes: (B, 5).
        friction: with the table, (B,).
        physics: (B, 20).

    Raises:
        InvalidInputError: arrays that do not fit together.
    """
    check_batch(scenes, pushes, friction, bodies)
    bodies = bodies.fitted(scenes.shape[1])
    limits = PushLimits(tool_radius=config.tool_radius, clearance=config.clearance)
    ways = tool_ways(scenes, pushes, limits, bodies)
    after, order = plain(scenes.copy()), nearest_first(scenes, pushed_bodies(pushes))
    touched, none = np.zeros(scenes.shape[:2], dtype=bool), np.empty((len(scenes), 0, OF_DISKS))
    table = body_table(bodies, config.bottom, config.pressure)
    rows = after, order, ways, plain(friction), table, plain(physics), touched, none
    run_blocks(lambda first: push_varied_block(first, *rows), len(scenes), CHUNK)
    return after
