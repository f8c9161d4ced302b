"""Rollouts of a network on a prior that it can learn from: the paper's equations 3 to 5."""

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from sain_core.dynamics import Dynamics
from sain_core.push import LENGTH, LOCATION
from sain_core.scene import POSE
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.threads import settle_threads
from sain_model.data.windows import Windows
from sain_model.dynamics.rollout_inputs import Physics, see
from sain_model.dynamics.settings import NO_GRADIENT, PHYSICS, LossConfig, RolloutConfig
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.planar import step_knowing

PushFrictions = Float[ndarray, "W T"]  # the friction that the prior is conditioned on


def roll(
    network: InteractionNetwork,
    windows: Windows,
    prior: Dynamics,
    config: RolloutConfig,
    friction: PushFrictions | None = None,
) -> Float[Tensor, "W T N 3"]:
    """Return the poses that a network predicts over windows, fed with its own predictions.

    Args:
        network: whose corrections are learned.
        windows: where to start from, and which pushes.
        prior: what is corrected.
        config: how steps hang together.
        friction: of each push, for the planar prior; None: the nominal one.
    """
    pose = torch.from_numpy(windows.scenes[..., POSE])
    own = windows.scenes
    poses = []
    for step in range(windows.steps):
        pushes = windows.pushes[:, step]
        physics = _physics(prior, None if friction is None else friction[:, step])
        if config.chain == PHYSICS:
            own = physics(own, pushes, np.arange(len(own)))
            physics = _given(own)
        if config.gradient == NO_GRADIENT:
            pose = pose.detach()
        frame = network.config.features
        seen = see(pose, windows.scenes, pushes, physics, frame, config.gradient)
        settle_threads()
        moved = seen.moved + _into_world(network(seen.disks, seen.relations).double(), pushes)
        idle = torch.from_numpy(pushes[:, LENGTH] == 0.0)[:, None, None]
        pose = pose + moved.masked_fill(idle, 0.0)
        poses.append(pose)
    return torch.stack(poses, dim=1)


def rollout_loss(poses: Float[Tensor, "W T N 3"], windows: Windows, config: LossConfig) -> Tensor:
    """Return Algorithm 1's loss, a mean over all pushes of the windows: equation 5's sum.

    Velocities are left out: scenes are settled, and no network changes them.
    """
    missing = torch.from_numpy(windows.next_scenes[..., POSE]) - poses
    squares = [
        (missing[..., :2] / config.position_scale).square().sum(-1),
        (2.0 - 2.0 * torch.cos(missing[..., 2])) / config.heading_scale**2,
    ]
    if config.robust:
        squares = [2.0 * (torch.sqrt(1.0 + square) - 1.0) for square in squares]
    known = torch.from_numpy(windows.known)
    total: Tensor = (squares[0] + squares[1]).mean(dim=-1)[known].mean()
    return total


def _physics(prior: Dynamics, friction: Scalars | None) -> Physics:
    def predict(scenes: Scenes, pushes: Pushes, rows: ndarray) -> Scenes:
        return step_knowing(prior, scenes, pushes, None if friction is None else friction[rows])

    return predict


def _given(physics_next: Scenes) -> Physics:
    return lambda scenes, pushes, rows: physics_next[rows]


def _into_world(residual: Float[Tensor, "B N 3"], pushes: Pushes) -> Float[Tensor, "B N 3"]:
    """Turn residuals out of the frame of the push."""
    heading = torch.from_numpy(pushes[:, LOCATION])[:, None]
    cos, sin = torch.cos(heading), torch.sin(heading)
    x, y, turn = residual.unbind(-1)
    return torch.stack([cos * x - sin * y, sin * x + cos * y, turn], dim=-1)
