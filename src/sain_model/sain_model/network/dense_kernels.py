"""Layers of a network, compiled: a dense layer, and what comes between two of them.

Arrays lie feature by feature, (features, LANES). A tile of a dense layer is 4 outputs of two
vectors of lanes. Its sums stay in registers over all inputs. LLVM finds no such loop by itself: it
is written as vector instructions here, whatever their size is on this machine.
"""

from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.codegen import get_host_cpu_features
from numba.extending import intrinsic

from sain_model.compute.compiling import compiled
from sain_model.network.feature_kernels import LANES

TILE: Final = 4  # inputs x outputs of which weights lie together; widths are padded to it
WIDTH: Final = 16 if "+avx512f" in get_host_cpu_features() else 8  # lanes of a vector
ABREAST: Final = 2  # vectors of a tile
STRIDE: Final = ABREAST * WIDTH  # lanes that are computed at a time

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

INDEX: Final = ir.IntType(64)
VECTOR: Final = ir.VectorType(ir.FloatType(), WIDTH)


@compiled
def dense(weights, at, inputs, outputs, x, y, lanes):
    """Write a layer's outputs (outputs, LANES) in the first lanes, at least so many.

    Its tiles begin at `at` in the weights.
    """
    bias = at + inputs * outputs
    for lane in range(0, lanes, STRIDE):
        for output in range(0, outputs, TILE):
            write_tile(weights, at, bias, inputs, output, lane, x, y)  # type: ignore[call-arg]


@compiled
def silu(y, rows, lanes):
    """Replace the first rows by v sigmoid(v) = v (1 + tanh(v / 2)) / 2, in the first lanes."""
    for row in range(rows):
        for lane in range(-(-lanes // STRIDE) * STRIDE):
            half = HALF * y[row, lane]
            z = min(max(half, -FLAT), FLAT)
            s = z * z
            p = ((((((P6 * s + P5) * s + P4) * s + P3) * s + P2) * s + P1) * s + P0) * z
            q = ((Q3 * s + Q2) * s + Q1) * s + Q0
            y[row, lane] = half * (ONE + p / q)


@intrinsic
def write_tile(_context, weights, at, bias, inputs, output, lane, x, y):
    """Write 4 rows of outputs from `output` on, in `STRIDE` lanes from `lane` on.

    The weights (4, 4) of 4 outputs and 4 inputs lie together, the tiles of all inputs in a row.
    """
    signature = types.void(weights, at, bias, inputs, output, lane, x, y)
    return signature, _build_tile


def _build_tile(context: Any, builder: ir.IRBuilder, signature: Any, given: Any) -> ir.Value:
    """Build the instructions of `write_tile`."""
    weights, x, y = (
        context.make_array(signature.args[place])(context, builder, given[place]).data
        for place in (0, 6, 7)
    )
    at, bias, inputs, output, lane = given[1:6]
    lanes = [builder.add(lane, INDEX(number * WIDTH)) for number in range(ABREAST)]
    sums = [[cgutils.alloca_once(builder, VECTOR) for _ in lanes] for _ in range(TILE)]
    outputs = [builder.add(output, INDEX(row)) for row in range(TILE)]
    for row, vectors in zip(outputs, sums, strict=True):
        first = _in_all_lanes(builder, weights, builder.add(bias, row))
        for one in vectors:
            builder.store(first, one)
    fused = ir.FunctionType(VECTOR, [VECTOR] * 3)
    multiply_add = cgutils.get_or_insert_function(builder.module, fused, f"llvm.fma.v{WIDTH}f32")
    start = builder.add(at, builder.mul(output, inputs))
    loop = cgutils.for_range_slice(builder, INDEX(0), inputs, INDEX(TILE), intp=INDEX)
    with loop as (each, _):
        tile = builder.add(start, builder.mul(each, INDEX(TILE)))
        for column in range(TILE):
            source = builder.add(each, INDEX(column))
            values = [builder.load(_vector(builder, x, source, lane), align=4) for lane in lanes]
            for row, vectors in enumerate(sums):
                place = builder.add(tile, INDEX(TILE * row + column))
                factor = _in_all_lanes(builder, weights, place)
                for one, value in zip(vectors, values, strict=True):
                    total = builder.call(multiply_add, [factor, value, builder.load(one)])
                    builder.store(total, one)
    for row, vectors in zip(outputs, sums, strict=True):
        for lane, one in zip(lanes, vectors, strict=True):
            builder.store(builder.load(one), _vector(builder, y, row, lane), align=4)
    return context.get_dummy_value()


def _in_all_lanes(builder: ir.IRBuilder, array: ir.Value, place: ir.Value) -> ir.Value:
    """Build a vector that has one number of an array in all its lanes."""
    number, nothing = builder.load(builder.gep(array, [place])), ir.Constant(VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, number, ir.IntType(32)(0))
    every = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, nothing, every)


def _vector(builder: ir.IRBuilder, array: ir.Value, row: ir.Value, lane: ir.Value) -> ir.Value:
    """Build the address of a vector of lanes in a row of (rows, LANES)."""
    begin = builder.add(builder.mul(row, INDEX(LANES)), lane)
    return builder.bitcast(builder.gep(array, [begin]), VECTOR.as_pointer())
