"""The mixed loss of the paper's Algorithm 1, line 17."""

import torch
from jaxtyping import Float
from torch import Tensor

from sain_model.data.examples import Examples
from sain_model.dynamics.settings import LossConfig


def mixed_loss(
    predicted: Float[Tensor, "*M B N 3"], examples: Examples, rows: Tensor, config: LossConfig
) -> Float[Tensor, "*M"]:
    """Return Algorithm 1's loss of batches: position, velocity, sine and cosine of the heading.

    It is a function of what is left of the residual alone: distances do not depend on the frame,
    and |sin a - sin b|^2 + |cos a - cos b|^2 = 2 - 2 cos(a - b).
    """
    missing = examples.residual[rows] - predicted
    squares = [
        (missing[..., :2] / config.position_scale).square().sum(-1),
        (examples.velocity[rows] / config.velocity_scale).square().sum(-1),
        (2.0 - 2.0 * torch.cos(missing[..., 2])) / config.heading_scale**2,
    ]
    if config.robust:
        squares = [2.0 * (torch.sqrt(1.0 + square) - 1.0) for square in squares]
    total: Tensor = squares[0] + squares[1] + squares[2]
    return total.mean(dim=(-2, -1))
