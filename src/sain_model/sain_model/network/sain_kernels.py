"""SAIN, compiled: predictions corrected, and whole rollouts, one block of pushes at a time.

A rollout takes a block of sequences through all pushes at once: prior, features, network, next
push, without leaving the core's own cache and without waiting for other threads. Which thread
takes which block is not said here (`sain_model.compute.thread_pool`), and makes no difference.
"""

import numpy as np

from sain_core.push import LENGTH, LOCATION
from sain_core.scene import STATE_SIZE, TARGET, THETA, X, Y
from sain_model.compute.compiling import callable_kernel, compiled
from sain_model.network.feature_kernels import LANES, make_network_work, wrap, write_lane
from sain_model.network.network_kernels import forward
from sain_model.network.shape_feature_kernels import make_shape_work, write_shape_lane
from sain_model.physics.body_kernels import make_workspace
from sain_model.physics.planar_kernels import push_scene


@compiled
def make_work(disks, weights):
    """Return scratch memory for the network."""
    relation_inputs, disk_inputs = weights.relation_widths[0], weights.dynamics_widths[0]
    return make_network_work(disks, relation_inputs, disk_inputs, weights.widest)


@compiled
def apply(push, residual, lane, scene):
    """Add the residual of a lane to a scene (N, 8) that the prior predicts."""
    cos, sin = np.cos(push[LOCATION]), np.sin(push[LOCATION])
    for disk in range(scene.shape[0]):
        x, y = residual[disk, 0, lane], residual[disk, 1, lane]
        scene[disk, X] += cos * x - sin * y
        scene[disk, Y] += sin * x + cos * y
        scene[disk, THETA] = wrap(scene[disk, THETA] + residual[disk, 2, lane])


@callable_kernel
def correct_block(first, scenes, pushes, physics_next, places, weights):
    """Correct up to `LANES` predictions, from the one numbered `first` on, in place.

    Args:
        first: number of the first one.
        scenes: (B, N, 8), before the pushes.
        pushes: (B, 3).
        physics_next: (B, N, 8), what a prior predicts; becomes the prediction.
        places: whether the network sees places and headings.
        weights: of the network.
    """
    work = make_work(scenes.shape[1], weights)
    last = min(first + LANES, scenes.shape[0])
    for index in range(first, last):
        write_lane(scenes[index], pushes[index], physics_next[index], index - first, places, work)
    forward(weights, work)
    for index in range(first, last):
        if pushes[index, LENGTH] != 0.0:
            apply(pushes[index], work.residual, index - first, physics_next[index])


@callable_kernel
def correct_shapes_block(first, scenes, strokes, physics_next, table, places, weights):
    """Correct up to `LANES` predictions of bodies of any shape, as `correct_block`.

    Args:
        first: number of the first one.
        scenes: (B, N, 8), before the pushes.
        strokes: (B, 6), see `network.shape_feature_kernels`.
        physics_next: (B, N, 8), what a prior predicts; becomes the prediction.
        table: of the outlines.
        places: whether the network sees places and headings.
        weights: of the network.
    """
    relation_inputs, body_inputs = weights.relation_widths[0], weights.dynamics_widths[0]
    work = make_shape_work(scenes.shape[1], relation_inputs, body_inputs, weights.widest)
    last = min(first + LANES, scenes.shape[0])
    for index in range(first, last):
        lane = index - first
        after = physics_next[index]
        write_shape_lane(scenes[index], strokes[index], after, table, lane, places, work)
    forward(weights, work)
    for index in range(first, last):
        if strokes[index, LENGTH] != 0.0:
            apply(strokes[index], work.residual, index - first, physics_next[index])


@compiled
def sort_disks(scene, order):
    """Order the disks as the prior wants them: from 2 on by their distance to the target."""
    for disk in range(scene.shape[0]):
        order[disk] = disk
    for disk in range(3, scene.shape[0]):
        place = disk
        while place > 2 and _apart(scene, disk) < _apart(scene, order[place - 1]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = disk


@compiled
def _apart(scene, disk):
    dx, dy = scene[disk, X] - scene[TARGET, X], scene[disk, Y] - scene[TARGET, Y]
    return dx * dx + dy * dy


@compiled
def copy_scene(scene, copy):
    """Copy a scene (N, 8)."""
    for disk in range(scene.shape[0]):
        copy_disk(scene[disk], copy[disk])


@compiled
def predict_physics(before, push, friction, start, physics, order, ordered, after, bodies, touched):
    """Write what the prior predicts for one push from a scene (N, 8)."""
    sort_disks(before, order)
    for disk in range(before.shape[0]):
        copy_disk(before[order[disk]], ordered[disk])
    push_scene(ordered, push, friction, start, physics, bodies, touched)
    for disk in range(before.shape[0]):
        copy_disk(ordered[disk], after[order[disk]])


@compiled
def copy_disk(disk, copy):
    """Copy the state of a disk (8,). A loop: assigning to a slice takes seconds to compile."""
    for column in range(STATE_SIZE):
        copy[column] = disk[column]


@callable_kernel
def roll_out_block(first, scene, pushes, friction, start, physics, places, weights, predicted):
    """Predict up to `LANES` sequences of pushes, from the one numbered `first` on.

    Args:
        first: number of the first one.
        scene: (N, 8), before the first push.
        pushes: (K, H, 3). A push of no length moves nothing.
        friction: with the table.
        start: from the mid disk's centre to the tool's axis before it travels [m].
        physics: the rest of the prior.
        places: whether the network sees places and headings.
        weights: of the network.
        predicted: (K, H, N, 8), receives the scene after each push.
    """
    disks, last = scene.shape[0], min(first + LANES, pushes.shape[0])
    work, bodies = make_work(disks, weights), make_workspace(disks)
    order, ordered = np.zeros(disks, np.int64), np.zeros((disks, STATE_SIZE))
    touched = np.zeros(disks, np.bool_)  # by the tool; nobody asks
    for step in range(pushes.shape[1]):
        for index in range(first, last):
            push, after = pushes[index, step], predicted[index, step]
            before = scene if step == 0 else predicted[index, step - 1]
            if push[LENGTH] > 0.0:
                predict_physics(
                    before, push, friction, start, physics, order, ordered, after, bodies, touched
                )
                write_lane(before, push, after, index - first, places, work)
            else:
                copy_scene(before, after)
        forward(weights, work)
        for index in range(first, last):
            if pushes[index, step, LENGTH] > 0.0:
                apply(pushes[index, step], work.residual, index - first, predicted[index, step])
