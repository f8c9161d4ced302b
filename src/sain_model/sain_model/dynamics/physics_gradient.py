"""The planar prior as a step of a network: forward it simulates, backward it simulates variations.

Contacts begin and end, so a push has no derivative everywhere. A difference over a tenth of a
correction's unit has one, and is what matters: how the push answers to a correction that large.
"""

from typing import Any, Final, NamedTuple, Self

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from sain_core.push import pushed_bodies
from sain_core.types import Indices, Pushes, Scenes
from sain_model.network.corrections import CORRECTIONS, OF_DISKS, Corrections, corrected_values
from sain_model.network.features import Strokes, true_residual
from sain_model.network.inputs import TURN_SCALE
from sain_model.physics.parameters import Values
from sain_model.physics.planar import PlanarPrior

VARIATION: Final = 0.1  # of a correction, in its unit
STEEPEST: Final = np.array([0.1, 0.1, 20 * TURN_SCALE])  # [m, m, rad] a unit; more is a miss


class ToldPushes(NamedTuple):
    """Pushes on a prior, as corrections change them.

    Attributes:
        prior: told the bodies.
        scenes: before the pushes.
        pushes: one a scene.
        frames: of the pushes, as `network.features.push_frames` makes them.
        values: of the prior's parameters that differ from its settings, (B,) by name.
    """

    prior: PlanarPrior
    scenes: Scenes
    pushes: Pushes
    frames: Strokes
    values: Values

    def moves(self, corrections: Corrections) -> Float[ndarray, "B N 3"]:
        """Return the moves that the prior predicts when told corrections (B, N, C)."""
        corrected = corrected_values(corrections, self.pushes, self.prior.config)
        values = {**self.values, **corrected}
        return moves(self.scenes, self.frames, self.prior.step(self.scenes, self.pushes, values))

    def repeated(self, times: int) -> Self:
        """Return the pushes so many times, one after the other."""
        rows = np.tile(np.arange(len(self.pushes)), times)
        return self.select(rows)

    def select(self, rows: Indices) -> Self:
        """Return the pushes in these rows."""
        values = {name: value[rows] for name, value in self.values.items()}
        arrays = self.scenes[rows], self.pushes[rows], self.frames[rows]
        return type(self)(self.prior, *arrays, values)


def moves(scenes: Scenes, frames: Strokes, after: Scenes) -> Float[ndarray, "B N 3"]:
    """Return how far each body goes along the push and across it [m], and turns [rad]."""
    return true_residual(after, frames, scenes)  # that of a prior in which nothing moves


def conditioned_moves(
    corrections: Float[Tensor, "B N C"], pushes: ToldPushes
) -> Float[Tensor, "B N 3"]:
    """Return the moves that a prior predicts when told corrections; gradients flow to those."""
    result: Tensor = _ConditionedMoves.apply(corrections, pushes)
    return result


class _ConditionedMoves(torch.autograd.Function):
    """`conditioned_moves`, forward and backward."""

    @staticmethod
    def forward(
        context: Any,
        corrections: Tensor,
        pushes: ToldPushes,
    ) -> Tensor:
        told = corrections.detach().numpy().astype(np.float64)
        after = pushes.moves(told)
        context.push = (told, pushes, after)
        return torch.from_numpy(after.astype(np.float32))

    @staticmethod
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        slopes = variations(*context.push)
        total = np.einsum("bncdm,bdm->bnc", slopes, gradients[0].numpy())
        return torch.from_numpy(total.astype(np.float32)), None


def variations(
    told: Corrections, pushes: ToldPushes, after: Float[ndarray, "B N 3"]
) -> Float[ndarray, "B N C N 3"]:
    """Return by how much the moves of all bodies change with each correction of each body."""
    batch, count, _ = pushes.scenes.shape
    rows, pushed = np.arange(batch), pushed_bodies(pushes.pushes)
    which = [(np.full(batch, body), c) for body in range(count) for c in range(OF_DISKS)]
    which += [(pushed, c) for c in range(OF_DISKS, CORRECTIONS)]
    many = len(which)
    varied = np.repeat(told[None], many, axis=0)
    for row, (bodies, column) in enumerate(which):
        varied[row, rows, bodies, column] += VARIATION
    ends = pushes.repeated(many).moves(varied.reshape(many * batch, count, CORRECTIONS))
    change = (ends.reshape(many, batch, count, 3) - after) / VARIATION
    slopes = np.zeros((batch, count, CORRECTIONS, count, 3))
    for row, (bodies, column) in enumerate(which):
        slopes[rows, bodies, column] = np.clip(change[row], -STEEPEST, STEEPEST)
    return slopes
