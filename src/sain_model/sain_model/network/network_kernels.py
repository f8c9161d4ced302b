"""The interaction network's forward pass, compiled: many pushes side by side, one in each lane.

Arrays lie feature by feature, (features, LANES), so that the innermost loops run over lanes, all
of them alike: they become vector instructions, and what one push gets does not depend on its
neighbours, on the size of the batch or on the number of threads. In single precision, as PyTorch
computes it.
"""

from typing import NamedTuple

import numpy as np

from sain_core.push import LENGTH, LOCATION
from sain_core.scene import THETA, X, Y
from sain_model.compute.compiling import (
    callable_kernel,
    compiled,
    compiled_apart,
)
from sain_model.network.dense_kernels import dense, silu
from sain_model.network.feature_kernels import (
    GAP_AFTER,
    GAP_BEFORE,
    LANES,
    MOVE_SCALE,
    WAY,
    make_work,
    wrap,
    write_lane,
)

# A kernel's corrections are shares of the error that its physics makes, which grows with the way.
LEAST_ERROR = np.float32(0.0008)  # [m]
ERROR_SHARE = np.float32(0.06)
MOST_ERROR = np.float32(0.003)  # [m]

OUTPUTS = 3  # dx, dy, dtheta

ONE, THREE = np.float32(1.0), np.float32(3.0)


class PackedWeights(NamedTuple):
    """A network of M members as the kernels take it: tiles of weights, then biases, layer by layer.

    Widths are padded with zeros to multiples of `TILE`.
    """

    relation: np.ndarray  # (M, ...) float32
    relation_widths: np.ndarray  # (layers + 1,) int64, of inputs, hidden layers and output
    dynamics: np.ndarray  # (M, ...) float32
    dynamics_widths: np.ndarray
    widest: int  # of all layers
    message: int  # width of a message from one body to another, without padding
    body_features: int  # inputs of f_dyn that are no message
    unit: np.ndarray  # (3,) float64, [m, m, rad], an output of 1
    # of a kernel on C pushes, which takes the place of f_rel and f_dyn; C = 0: of a network
    columns: np.ndarray  # (F,) int64, of a body's features and, behind them, of its tool's relation
    scales: np.ndarray  # (F,) float32, of these columns
    centres: np.ndarray  # (C, F) float32, scaled
    outputs: np.ndarray  # (C, 3) float32


@compiled_apart
def perceptron(weights, widths, x, hidden, lanes):
    """Write what a member's perceptron makes of inputs (inputs, LANES) in the first lanes.

    The padding of inputs is zero.

    Returns in which of the two `hidden` buffers that is.
    """
    at, source, last = 0, x, len(widths) - 2
    for layer in range(last + 1):
        inputs, outputs = widths[layer], widths[layer + 1]
        target = hidden[layer % 2]
        dense(weights, at, inputs, outputs, source, target, lanes)
        if layer < last:
            silu(target, outputs, lanes)
        at += (inputs + 1) * outputs
        source = target
    return last % 2


@compiled
def sum_messages(weights, work, lanes):
    """Add up the messages of the others to each body.

    Disks far apart send no messages, so that more of them change nothing either. All others are
    packed, so that no lane is idle.
    """
    relations, others, count = work.relations, work.bodies.shape[0], 0
    for member in range(work.messages.shape[0]):
        for body in range(work.messages.shape[1]):
            for row in range(weights.message):
                for lane in range(LANES):
                    work.messages[member, body, row, lane] = 0.0
    for number in range(relations.shape[0]):
        pair, body = relations[number], number // others
        for lane in range(lanes):
            if min(pair[GAP_BEFORE, lane], pair[GAP_AFTER, lane]) != ONE:
                for row in range(pair.shape[0]):
                    work.packed[row, count] = pair[row, lane]
                work.packed_from[count, 0], work.packed_from[count, 1] = body, lane
                count += 1
                if count == LANES:
                    _send(weights, work, count)
                    count = 0
    _send(weights, work, count)


@compiled_apart
def _send(weights, work, count):
    """Add the messages of so many packed relations to those of their bodies."""
    packed = work.packed
    for member in range(weights.relation.shape[0]):
        which = perceptron(
            weights.relation[member], weights.relation_widths, packed, work.hidden, count
        )
        told, messages = work.hidden[which], work.messages[member]
        for row in range(weights.message):
            for column in range(count):
                body, lane = work.packed_from[column, 0], work.packed_from[column, 1]
                near = ONE - min(packed[GAP_BEFORE, column], packed[GAP_AFTER, column])
                messages[body, row, lane] += told[row, column] * near


@compiled_apart
def add_kernel(weights, work):
    """Compute the residuals of the pushed bodies: Matern's kernel (3/2) about each centre."""
    count, residual, apart = work.bodies.shape[0], work.residual, work.hidden[0, 0]
    residual[:] = 0.0
    for body in range(count):
        inputs, tool = work.bodies[body], work.relations[body * count + body]
        for centre in range(weights.centres.shape[0]):
            apart[:] = 0.0
            for place in range(weights.columns.shape[0]):
                column, scale = weights.columns[place], weights.scales[place]
                off = column - weights.body_features
                row, middle = (
                    tool[off] if off >= 0 else inputs[column],
                    weights.centres[centre, place],
                )
                for lane in range(LANES):
                    apart[lane] += (scale * row[lane] - middle) ** 2
            for lane in range(LANES):
                root = np.sqrt(THREE * apart[lane])
                near = (ONE + root) * np.exp(-root)
                for output in range(OUTPUTS):
                    residual[body, output, lane] += near * weights.outputs[centre, output]
        for lane in range(LANES):
            error = min(LEAST_ERROR + ERROR_SHARE * MOVE_SCALE * inputs[WAY, lane], MOST_ERROR)
            for output in range(OUTPUTS):
                residual[body, output, lane] *= inputs[0, lane] * error * weights.unit[output]


@compiled_apart
def forward(weights, work, lanes):
    """Compute the residuals, the mean over the members, of the features in so many lanes."""
    members, residual, first = weights.relation.shape[0], work.residual, weights.body_features
    sum_messages(weights, work, lanes)
    for body in range(residual.shape[0]):
        for output in range(OUTPUTS):
            for lane in range(LANES):
                residual[body, output, lane] = 0.0
    for member in range(members):
        for body in range(work.bodies.shape[0]):
            inputs = work.bodies[body]
            for row in range(weights.message):
                for lane in range(LANES):
                    inputs[first + row, lane] = work.messages[member, body, row, lane]
            which = perceptron(
                weights.dynamics[member], weights.dynamics_widths, inputs, work.hidden, lanes
            )
            told = work.hidden[which]
            for output in range(OUTPUTS):
                scale = weights.unit[output] / members
                for lane in range(LANES):
                    residual[body, output, lane] += told[output, lane] * scale


@compiled
def find_residuals(weights, work, lanes):
    """Compute the residuals by a network, or by a kernel."""
    if weights.centres.shape[0] > 0:
        add_kernel(weights, work)
    else:
        forward(weights, work, lanes)


@compiled
def apply(push, residual, lane, scene):
    """Add the residual of a lane to a scene (N, 8) that the prior predicts."""
    cos, sin = np.cos(push[LOCATION]), np.sin(push[LOCATION])
    for body in range(scene.shape[0]):
        x, y = residual[body, 0, lane], residual[body, 1, lane]
        scene[body, X] += cos * x - sin * y
        scene[body, Y] += sin * x + cos * y
        scene[body, THETA] = wrap(scene[body, THETA] + residual[body, 2, lane])


@compiled_apart
def correct(first, last, scenes, strokes, physics_next, believed, table, places, weights, work):
    """Correct what `correct_block` does, with its scratch memory."""
    for index in range(first, last):
        row = min(index, believed.shape[0] - 1)
        given = scenes[index], strokes[index], physics_next[index], believed[row]
        write_lane(*given, table, index - first, places, work)
    find_residuals(weights, work, last - first)
    for index in range(first, last):
        if strokes[index, LENGTH] != 0.0:
            apply(strokes[index], work.residual, index - first, physics_next[index])


@callable_kernel
def correct_block(first, last, scenes, strokes, physics_next, believed, table, places, weights):
    """Correct up to `LANES` predictions (B, N, 8) in place, from number `first` to before `last`.

    There may be fewer. `believed` (B, N, P), or (1, N, P) for all, is what the network sees of what
    is believed of the physics; `places`: whether it sees places and headings.
    """
    inputs = weights.relation_widths[0], weights.dynamics_widths[0]
    sizes = weights.widest, weights.relation.shape[0], weights.message
    work = make_work(scenes.shape[1], table.corners.shape[0], *inputs, *sizes)
    end = min(last, scenes.shape[0])
    correct(first, end, scenes, strokes, physics_next, believed, table, places, weights, work)
