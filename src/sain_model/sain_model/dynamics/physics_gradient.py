"""The planar prior as a step of a network: forward it simulates, backward it simulates variations.

Contacts begin and end, so a push has no derivative everywhere. A difference over a tenth of a
correction's unit has one, and is what matters: how the push answers to a correction that large.
"""

from typing import Any, Final

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from sain_core.scene import MID
from sain_core.types import Pushes, Scenes
from sain_model.network.feature_kernels import TURN_SCALE
from sain_model.network.features import true_residual
from sain_model.physics.corrections import CORRECTIONS, OF_DISKS, Corrections
from sain_model.physics.planar import PlanarPrior

VARIATION: Final = 0.1  # of a correction, in its unit
STEEPEST: Final = np.array([0.1, 0.1, 20 * TURN_SCALE])  # [m, m, rad] a unit; more is a miss


def moves(scenes: Scenes, pushes: Pushes, after: Scenes) -> Float[ndarray, "B N 3"]:
    """Return how far each disk goes along the push and across it [m], and turns [rad]."""
    return true_residual(after, pushes, scenes)  # that of a prior in which nothing moves


def conditioned_moves(
    corrections: Float[Tensor, "B N C"],
    prior: PlanarPrior,
    scenes: Scenes,
    pushes: Pushes,
) -> Float[Tensor, "B N 3"]:
    """Return the moves that a prior predicts when told corrections; gradients flow to those."""
    result: Tensor = _ConditionedMoves.apply(corrections, prior, scenes, pushes)
    return result


class _ConditionedMoves(torch.autograd.Function):
    """`conditioned_moves`, forward and backward."""

    @staticmethod
    def forward(
        context: Any,
        corrections: Tensor,
        prior: PlanarPrior,
        scenes: Scenes,
        pushes: Pushes,
    ) -> Tensor:
        told = corrections.detach().numpy().astype(np.float64)
        after = moves(scenes, pushes, prior.step_conditioned(scenes, pushes, told))
        context.push = (told, prior, scenes, pushes, after)
        return torch.from_numpy(after.astype(np.float32))

    @staticmethod
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor, None, None, None]:
        slopes = variations(*context.push)
        total = np.einsum("bncdm,bdm->bnc", slopes, gradients[0].numpy())
        return torch.from_numpy(total.astype(np.float32)), None, None, None


def variations(
    told: Corrections,
    prior: PlanarPrior,
    scenes: Scenes,
    pushes: Pushes,
    after: Float[ndarray, "B N 3"],
) -> Float[ndarray, "B N C N 3"]:
    """Return by how much the moves of all disks change with each correction of each disk."""
    batch, count, _ = scenes.shape
    slopes = np.zeros((batch, count, CORRECTIONS, count, 3))
    which = [(d, c) for d in range(count) for c in range(OF_DISKS if d != MID else CORRECTIONS)]
    varied = np.repeat(told[None], len(which), axis=0)
    for row, (disk, column) in enumerate(which):
        varied[row, :, disk, column] += VARIATION
    many = len(which)
    scenes, pushes = np.tile(scenes, (many, 1, 1)), np.tile(pushes, (many, 1))
    flat = varied.reshape(many * batch, count, CORRECTIONS)
    ends = moves(scenes, pushes, prior.step_conditioned(scenes, pushes, flat))
    change = (ends.reshape(many, batch, count, 3) - after) / VARIATION
    for row, (disk, column) in enumerate(which):
        slopes[:, disk, column] = np.clip(change[row], -STEEPEST, STEEPEST)
    return slopes
