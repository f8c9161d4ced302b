"""The mixed loss of the paper's Algorithm 1, line 17, and its sum over rollouts, equation 5."""

import functools

import torch
from jaxtyping import Float
from torch import Tensor

from sain_core.scene import POSE
from sain_model.data.examples import Examples
from sain_model.data.windows import Windows
from sain_model.training.settings import LossConfig


def mixed_loss(
    predicted: Float[Tensor, "*M B N 3"], examples: Examples, rows: Tensor, config: LossConfig
) -> Float[Tensor, "*M"]:
    """Return Algorithm 1's loss of batches: position, velocity, sine and cosine of the heading.

    It is a function of what is left of the residual alone: distances do not depend on the frame,
    and |sin a - sin b|^2 + |cos a - cos b|^2 = 2 - 2 cos(a - b).
    """
    missing = examples.residual[rows] - predicted
    position, heading = _pose_squares(missing, config)
    velocity = (examples.velocity[rows] / config.velocity_scale).square().sum(-1)
    squares = [position, velocity, heading]
    return _total(squares, config).mean(dim=(-2, -1))


def rollout_loss(poses: Float[Tensor, "W T N 3"], windows: Windows, config: LossConfig) -> Tensor:
    """Return Algorithm 1's loss, a mean over all pushes of the windows: equation 5's sum.

    Velocities are left out: scenes are settled, and no network changes them.
    """
    missing = torch.from_numpy(windows.next_scenes[..., POSE]) - poses
    known = torch.from_numpy(windows.known)
    return _total(_pose_squares(missing, config), config).mean(dim=-1)[known].mean()


def _pose_squares(missing: Float[Tensor, "*B 3"], config: LossConfig) -> list[Tensor]:
    return [
        (missing[..., :2] / config.position_scale).square().sum(-1),
        (2.0 - 2.0 * torch.cos(missing[..., 2])) / config.heading_scale**2,
    ]


def _total(squares: list[Tensor], config: LossConfig) -> Tensor:
    if config.robust:
        squares = [2.0 * (torch.sqrt(1.0 + square) - 1.0) for square in squares]
    return functools.reduce(torch.add, squares)
