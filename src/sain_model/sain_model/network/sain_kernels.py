"""Predictions of a prior corrected by the network, compiled, one block of pushes at a time.

Which thread takes which block is not said here (`sain_model.compute.thread_pool`), and makes no
difference.
"""

import numpy as np

from sain_core.push import LENGTH, LOCATION
from sain_core.scene import THETA, X, Y
from sain_model.compute.compiling import callable_kernel, compiled
from sain_model.network.feature_kernels import make_work, wrap, write_lane
from sain_model.network.inputs import LANES
from sain_model.network.network_kernels import forward


@compiled
def apply(push, residual, lane, scene):
    """Add the residual of a lane to a scene (N, 8) that the prior predicts."""
    cos, sin = np.cos(push[LOCATION]), np.sin(push[LOCATION])
    for body in range(scene.shape[0]):
        x, y = residual[body, 0, lane], residual[body, 1, lane]
        scene[body, X] += cos * x - sin * y
        scene[body, Y] += sin * x + cos * y
        scene[body, THETA] = wrap(scene[body, THETA] + residual[body, 2, lane])


@callable_kernel
def correct_block(first, scenes, strokes, physics_next, believed, table, places, weights):
    """Correct up to `LANES` predictions, from the one numbered `first` on, in place.

    Args:
        first: number of the first one.
        scenes: (B, N, 8), before the pushes.
        strokes: (B, 8), see `network.feature_kernels`.
        physics_next: (B, N, 8), what a prior predicts; becomes the prediction.
        believed: (B, N, P), what the network sees of what is believed of the physics.
        table: of the outlines.
        places: whether the network sees places and headings.
        weights: of the network.
    """
    relation_inputs, body_inputs = weights.relation_widths[0], weights.dynamics_widths[0]
    corners = table.corners.shape[0]
    work = make_work(scenes.shape[1], corners, relation_inputs, body_inputs, weights.widest)
    last = min(first + LANES, scenes.shape[0])
    for index in range(first, last):
        lane = index - first
        after = physics_next[index]
        write_lane(scenes[index], strokes[index], after, table, lane, places, work)
        for body in range(believed.shape[1]):
            for column in range(believed.shape[2]):
                row = weights.body_features - believed.shape[2] + column
                work.bodies[body, row, lane] = believed[index, body, column]
    forward(weights, work)
    for index in range(first, last):
        if strokes[index, LENGTH] != 0.0:
            apply(strokes[index], work.residual, index - first, physics_next[index])
