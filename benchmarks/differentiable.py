"""The network alone (Fig. 1b), rolled out in PyTorch: predictions that know their slopes.

What it sees is computed in torch as `network.features` computes it in NumPy, so that predicted
scenes can be differentiated by every push. On a prior other than the identity there is no such
rollout: contacts are compiled and not smooth.
"""

from copy import deepcopy
from typing import Final

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from sain_core.errors import InvalidInputError
from sain_core.push import ANGLE, LENGTH, LOCATION, PUSH_SIZE
from sain_core.scene import MID, POSE, RADIUS
from sain_core.types import Scene
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.sain import LEARNED, SainDynamics
from sain_model.network.feature_kernels import GAP_SCALE, PLACE_SCALE
from sain_model.network.features import make_features, relation_ends
from sain_model.network.settings import PUSH_FRAME

KINDS: Final = 3  # first columns of the disks' features: they are the same all the way


class DifferentiableRollout:
    """Predicts as a learned-only `SainDynamics` does, in double precision."""

    def __init__(self, sain: SainDynamics) -> None:
        """Copy the network.

        Raises:
            InvalidInputError: it has a prior, or sees where on the table things are.
        """
        if sain.kind != LEARNED or sain.network.config.features != PUSH_FRAME:
            raise InvalidInputError(
                f"a {sain.kind} network with features {sain.network.config.features!r} cannot be"
                f" differentiated: it must be {LEARNED}, with features {PUSH_FRAME!r}"
            )
        self._network = deepcopy(sain.network).cpu().double().requires_grad_(False)

    def rollout(self, scene: Scene, pushes: Float[Tensor, "K H 3"]) -> Float[Tensor, "K H N 3"]:
        """Return the poses x y [m], theta [rad] after each push of sequences from one scene (N, 8).

        Headings are not wrapped. A push of zero length moves nothing, and has no slope.
        """
        settle_threads()
        kinds = make_features(scene[None], np.zeros((1, PUSH_SIZE)), scene[None]).disks[
            0, :, :KINDS
        ]
        fixed = torch.from_numpy(kinds), torch.from_numpy(scene[:, RADIUS].copy())
        pose = torch.from_numpy(scene[:, POSE].copy()).expand(len(pushes), -1, -1)  # (K, N, 3)
        poses = []
        for push in pushes.unbind(dim=1):
            residual = self._network(*_features(pose, push, *fixed))
            idle = (push[:, LENGTH] == 0.0)[:, None, None]
            moved = torch.cat([_turn(residual[..., :2], push[:, LOCATION]), residual[..., 2:]], -1)
            pose = pose + moved.masked_fill(idle, 0.0)
            poses.append(pose)
        return torch.stack(poses, dim=1)


def _features(
    pose: Float[Tensor, "K N 3"],
    push: Float[Tensor, "K 3"],
    kinds: Float[Tensor, "N 3"],
    radii: Float[Tensor, " N"],
) -> tuple[Float[Tensor, "K N D"], Float[Tensor, "K E R"]]:
    """Return what the network sees when the prior says that nothing moves."""
    location, angle, length = push[:, LOCATION], push[:, ANGLE], push[:, LENGTH]
    places = _turn(pose[..., :2] - pose[:, MID : MID + 1, :2], -location)  # (K, N, 2)
    feet = 3 * (pose[..., 2] - location[:, None])
    still = torch.zeros_like(places[..., :1]).expand(-1, -1, 4)
    stroke = length / PLACE_SCALE
    pushed = torch.stack([stroke, angle.cos(), angle.sin(), stroke * angle.sin()], dim=-1)
    each = pose.shape[1]
    disks = [
        kinds.expand(len(pose), -1, -1),
        places / PLACE_SCALE,
        feet.cos()[..., None],
        feet.sin()[..., None],
        still,
        pushed[:, None].expand(-1, each, -1),
    ]
    return torch.cat(disks, dim=-1), _relations(places, kinds, radii)


def _relations(
    places: Float[Tensor, "K N 2"], kinds: Float[Tensor, "N 3"], radii: Float[Tensor, " N"]
) -> Float[Tensor, "K E R"]:
    receiver, sender = map(torch.from_numpy, relation_ends(len(radii)))
    offset = places[:, sender] - places[:, receiver]
    distance = offset.norm(dim=-1, keepdim=True)
    rims = (radii[receiver] + radii[sender])[:, None]
    gap = torch.tanh((distance - rims) / GAP_SCALE)
    apart = torch.cat([offset / PLACE_SCALE, offset / (distance + 1e-9), gap], dim=-1)
    pair = torch.cat([kinds[receiver], kinds[sender]], dim=-1).expand(len(places), -1, -1)
    return torch.cat([pair, apart, apart], dim=-1)  # before the push and after it


def _turn(vectors: Float[Tensor, "K N 2"], angle: Float[Tensor, " K"]) -> Float[Tensor, "K N 2"]:
    """Return vectors turned by an angle [rad] each."""
    cos, sin = angle.cos()[:, None], angle.sin()[:, None]
    x, y = vectors.unbind(dim=-1)
    return torch.stack([cos * x - sin * y, sin * x + cos * y], dim=-1)
