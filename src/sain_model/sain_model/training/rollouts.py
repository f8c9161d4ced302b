"""Rollouts of a network on a prior that it can learn from: the paper's equations 3 and 4.

The prior is compiled and its contacts are not smooth: no automatic differentiation passes through
it. A loss on a later step reaches an earlier one by finite differences of prior and features
together (docs/explanation/rollouts.md). The prior goes on from the corrected scene.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from sain_core.model import Model
from sain_core.push import LENGTH, LOCATION
from sain_core.scene import POSE, THETA, unit, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.threads import settle_threads
from sain_model.data.windows import Windows
from sain_model.network.features import network_inputs, push_frames
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import Values
from sain_model.physics.planar import step_knowing

STEPS: Final = (2e-4, 2e-4, 2e-3)  # [m, m, rad], of the finite differences: well above rounding

Look = Callable[[Scenes, Pushes, ndarray], tuple[ndarray, ...]]
"""Returns what is seen in scenes with pushes, which are these rows of the batch."""


def roll(
    network: InteractionNetwork,
    windows: Windows,
    prior: Model,
    values: Values | None = None,
    bodies: Bodies = PAPER_DISKS,
) -> Float[Tensor, "W T N 3"]:
    """Return the poses that a network predicts over windows, fed with its own predictions.

    `values` (W, T) by name are those of the prior's parameters that differ from its settings.
    `prior` predicts these bodies.
    """
    pose = torch.from_numpy(windows.scenes[..., POSE])
    poses = []
    for step in range(windows.steps):
        pushes = windows.pushes[:, step]
        now = {name: value[:, step] for name, value in (values or {}).items()}
        look = partial(_look, prior, now, network.config, bodies)
        seen = see(pose, windows.scenes, pushes, look)
        settle_threads()
        residual = network(seen.bodies, seen.relations).double()
        moved = seen.moved + _into_world(residual, seen.heading)
        idle = torch.from_numpy(pushes[:, LENGTH] == 0.0)[:, None, None]
        pose = pose + moved.masked_fill(idle, 0.0)
        poses.append(pose)
    return torch.stack(poses, dim=1)


def _into_world(
    residual: Float[Tensor, "B N 3"], heading: Float[Tensor, "B 2"]
) -> Float[Tensor, "B N 3"]:
    """Turn residuals out of the frame of the push, given by cos and sin of its heading."""
    cos, sin = heading[:, :1], heading[:, 1:]
    x, y, turn = residual.unbind(-1)
    return torch.stack([cos * x - sin * y, sin * x + cos * y, turn], dim=-1)


class Seen(NamedTuple):
    """Network inputs and how the prior moves the disks, for B pushes."""

    bodies: Float[Tensor, "B N D"]
    relations: Float[Tensor, "B E R"]
    moved: Float[Tensor, "B N 3"]  # dx, dy [m], dtheta [rad], in the world
    heading: Float[Tensor, "B 2"]  # cos and sin of the frame of the push


def see(pose: Float[Tensor, "B N 3"], scenes: Scenes, pushes: Pushes, look: Look) -> Seen:
    """Return what the network sees in scenes with these poses.

    Args:
        pose: of each disk, predicted so far; what is returned may depend on it.
        scenes: with masses and radii; the poses in them are overwritten.
        pushes: one a scene.
        look: returns what is seen.
    """
    scenes = scenes.copy()
    scenes[..., POSE] = pose.detach().numpy()
    scenes[..., THETA] = wrap_angle(scenes[..., THETA])
    rows = np.arange(len(scenes))
    parts = look(scenes, pushes, rows)
    values = torch.from_numpy(_flat(parts))
    if pose.requires_grad:
        slopes = torch.from_numpy(_slopes(scenes, pushes, look, _flat(parts)))
        values = _Linearised.apply(pose, values, slopes)
    split = values.split([part[0].size for part in parts], dim=1)
    bodies, relations, moved, heading = (
        value.view(part.shape) for value, part in zip(split, parts, strict=True)
    )
    return Seen(bodies.float(), relations.float(), moved, heading)


def _look(
    prior: Model,
    values: Values,
    config: NetworkConfig,
    shapes: Bodies,
    scenes: Scenes,
    pushes: Pushes,
    rows: ndarray,
) -> tuple[ndarray, ...]:
    here = {name: value[rows] for name, value in values.items()}
    physics_next = step_knowing(prior, scenes, pushes, here)
    frames = push_frames(scenes, pushes, shapes)
    features = network_inputs(config, scenes, frames, physics_next, shapes)
    moved = physics_next[..., POSE] - scenes[..., POSE]
    moved[..., THETA] = wrap_angle(moved[..., THETA])
    return features.bodies, features.relations, moved, unit(frames[:, LOCATION])


def _flat(parts: tuple[ndarray, ...]) -> Float[ndarray, "B V"]:
    return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)


def _slopes(
    scenes: Scenes,
    pushes: Pushes,
    look: Look,
    values: Float[ndarray, "B V"],
) -> Float[ndarray, "B V P"]:
    """Return the derivative of all that is seen by each of the P = 3 N numbers of the poses."""
    batch, disks, _ = scenes.shape
    count = 3 * disks
    nudged = np.repeat(scenes[None], count, axis=0)  # (P, B, N, 8)
    for disk in range(disks):
        for column, step in enumerate(STEPS):
            nudged[3 * disk + column, :, disk, column] += step
    rows = np.tile(np.arange(batch), count)
    seen = _flat(look(nudged.reshape(-1, *scenes.shape[1:]), pushes[rows], rows)).reshape(
        count, batch, -1
    )
    steps = np.tile(STEPS, disks)[:, None, None]
    return np.ascontiguousarray(((seen - values) / steps).transpose(1, 2, 0))


class _Linearised(torch.autograd.Function):
    """Passes values on, and their gradients back by given slopes."""

    @staticmethod
    def forward(ctx: Any, pose: Tensor, values: Tensor, slopes: Tensor) -> Tensor:
        ctx.save_for_backward(slopes)
        ctx.shape = pose.shape
        return values.clone()

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        (slopes,) = ctx.saved_tensors
        return torch.einsum("bv,bvp->bp", gradient, slopes).view(ctx.shape), None, None
