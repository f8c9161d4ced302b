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
from sain_model.compute.compiling import callable_kernel, compiled, compiled_apart
from sain_model.network.feature_kernels import (
    GAP_AFTER,
    GAP_BEFORE,
    LANES,
    make_work,
    wrap,
    write_lane,
)

TILE = 4  # inputs x outputs that one pass of a dense layer takes; widths are padded to it
OUTPUTS = 3  # dx, dy, dtheta

HALF, ONE = np.float32(0.5), np.float32(1.0)
FLAT = np.float32(7.9)  # beyond it tanh is 1 in single precision
# tanh(z) ~ z P(z^2) / Q(z^2), a minimax approximation to a few units in the last place: Eigen's,
# https://gitlab.com/libeigen/eigen, generic_fast_tanh_float.
P0, P1, P2, P3, P4, P5, P6 = (
    np.float32(4.89352455891786e-03),
    np.float32(6.37261928875436e-04),
    np.float32(1.48572235717979e-05),
    np.float32(5.12229709037114e-08),
    np.float32(-8.60467152213735e-11),
    np.float32(2.00018790482477e-13),
    np.float32(-2.76076847742355e-16),
)
Q0, Q1, Q2, Q3 = (
    np.float32(4.89352518554385e-03),
    np.float32(2.26843463243900e-03),
    np.float32(1.18534705686654e-04),
    np.float32(1.19825839466702e-06),
)


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


@compiled
def dense(weights, at, inputs, outputs, x, y):
    """Write a layer's outputs (outputs, LANES); its tiles begin at `at` in the weights.

    One pass of the inner loop loads 4 inputs and adds to 4 outputs: 16 products for 8 loads and
    4 stores, which keeps the multipliers busy.
    """
    bias = at + inputs * outputs
    for o in range(0, outputs, TILE):
        t = bias + o
        a0, b0, c0, d0 = weights[t], weights[t + 1], weights[t + 2], weights[t + 3]
        for lane in range(LANES):
            y[o, lane], y[o + 1, lane], y[o + 2, lane], y[o + 3, lane] = a0, b0, c0, d0
        for k in range(0, inputs, TILE):
            t = at + o * inputs + TILE * k
            a0, a1, a2, a3 = weights[t], weights[t + 1], weights[t + 2], weights[t + 3]
            b0, b1, b2, b3 = weights[t + 4], weights[t + 5], weights[t + 6], weights[t + 7]
            c0, c1, c2, c3 = weights[t + 8], weights[t + 9], weights[t + 10], weights[t + 11]
            d0, d1, d2, d3 = weights[t + 12], weights[t + 13], weights[t + 14], weights[t + 15]
            for lane in range(LANES):
                x0, x1, x2, x3 = x[k, lane], x[k + 1, lane], x[k + 2, lane], x[k + 3, lane]
                y[o, lane] = y[o, lane] + a0 * x0 + a1 * x1 + a2 * x2 + a3 * x3
                y[o + 1, lane] = y[o + 1, lane] + b0 * x0 + b1 * x1 + b2 * x2 + b3 * x3
                y[o + 2, lane] = y[o + 2, lane] + c0 * x0 + c1 * x1 + c2 * x2 + c3 * x3
                y[o + 3, lane] = y[o + 3, lane] + d0 * x0 + d1 * x1 + d2 * x2 + d3 * x3


@compiled
def silu(y, rows):
    """Replace the first rows by v sigmoid(v) = v (1 + tanh(v / 2)) / 2."""
    for row in range(rows):
        for lane in range(LANES):
            half = HALF * y[row, lane]
            z = min(max(half, -FLAT), FLAT)
            s = z * z
            p = ((((((P6 * s + P5) * s + P4) * s + P3) * s + P2) * s + P1) * s + P0) * z
            q = ((Q3 * s + Q2) * s + Q1) * s + Q0
            y[row, lane] = half * (ONE + p / q)


@compiled_apart
def perceptron(weights, widths, x, hidden):
    """Write what a member's perceptron makes of inputs (inputs, LANES), whose padding is zero.

    Returns in which of the two `hidden` buffers that is.
    """
    at, source, last = 0, x, len(widths) - 2
    for layer in range(last + 1):
        inputs, outputs = widths[layer], widths[layer + 1]
        target = hidden[layer % 2]
        dense(weights, at, inputs, outputs, source, target)
        if layer < last:
            silu(target, outputs)
        at += (inputs + 1) * outputs
        source = target
    return last % 2


@compiled
def sum_messages(weights, member, body, work):
    """Add up the messages of the others to a body, into its inputs of f_dyn."""
    bodies, relations = work.bodies, work.relations
    others, first = relations.shape[0] // bodies.shape[0], weights.body_features
    for row in range(first, first + weights.message):
        for lane in range(LANES):
            bodies[body, row, lane] = 0.0
    for other in range(others):
        pair = relations[body * others + other]
        which = perceptron(weights.relation[member], weights.relation_widths, pair, work.hidden)
        told = work.hidden[which]
        # Disks far apart send no messages, so that more of them change nothing either.
        for row in range(weights.message):
            for lane in range(LANES):
                near = ONE - min(pair[GAP_BEFORE, lane], pair[GAP_AFTER, lane])
                bodies[body, first + row, lane] += told[row, lane] * near


@compiled_apart
def forward(weights, work):
    """Compute the residuals of the features in `work`, the mean over the members."""
    members, residual = weights.relation.shape[0], work.residual
    for body in range(residual.shape[0]):
        for output in range(OUTPUTS):
            for lane in range(LANES):
                residual[body, output, lane] = 0.0
    for member in range(members):
        for body in range(work.bodies.shape[0]):
            sum_messages(weights, member, body, work)
            inputs = work.bodies[body]
            which = perceptron(
                weights.dynamics[member], weights.dynamics_widths, inputs, work.hidden
            )
            told = work.hidden[which]
            for output in range(OUTPUTS):
                scale = weights.unit[output] / members
                for lane in range(LANES):
                    residual[body, output, lane] += told[output, lane] * scale


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
    """Correct up to `LANES` predictions (B, N, 8) in place, from the one numbered `first` on.

    `believed` (B, N, P) is what the network sees of what is believed of the physics; `places`:
    whether it sees places and headings.
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
