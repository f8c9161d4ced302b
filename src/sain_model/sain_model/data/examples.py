"""What a network learns from: its inputs and what it should say, for pushes on a prior."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from sain_core.model import Model
from sain_core.scene import VELOCITY
from sain_model.data.dataset import Part
from sain_model.inference.evidence import Known
from sain_model.inference.grid import grid_values
from sain_model.inference.kinds import Kind
from sain_model.network.features import (
    mirrored_columns,
    network_inputs,
    push_frames,
    relation_ends,
    true_residual,
)
from sain_model.network.inputs import GAP_AFTER, GAP_BEFORE
from sain_model.network.relation_kernels import MIRRORED_RELATION
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import Values
from sain_model.physics.planar import step_knowing

MIRRORED_MOTION: Final = (1, 2)  # across the push, and the turn


@dataclass(frozen=True)
class Examples:
    """Network inputs and what it should say, for M pushes."""

    bodies: Float[Tensor, "M N D"]
    relations: Float[Tensor, "M E R"]
    residual: Float[Tensor, "M N 3"]
    velocity: Float[Tensor, "M N 3"]  # error of the prior's velocity, which no network changes

    def __len__(self) -> int:
        """Return the number of pushes M."""
        return len(self.bodies)

    def padded(self, bodies: int) -> Self:
        """Return examples with so many bodies, those that are missing far from all others.

        A body that is far away tells others nothing, to the bit (`InteractionNetwork`): the
        network says the same of the bodies that exist. Of the others it should say zero.
        """
        count = self.bodies.shape[1]
        if count == bodies:
            return self
        receiver, sender = relation_ends(bodies)
        exist = torch.from_numpy((receiver < count) & (sender < count))
        relations = self.relations.new_zeros(len(self), len(exist), self.relations.shape[2])
        relations[..., [GAP_BEFORE, GAP_AFTER]] = 1.0
        relations[:, exist] = self.relations
        missing = (0, 0, 0, bodies - count)
        return type(self)(
            functional.pad(self.bodies, missing),
            relations,
            functional.pad(self.residual, missing),
            functional.pad(self.velocity, missing),
        )

    def mirrored(self, network: NetworkConfig = NetworkConfig()) -> Self:
        """Return the mirror images of examples for a network in the push frame: signs change."""
        flipped = {
            "bodies": mirrored_columns(network),
            "relations": MIRRORED_RELATION,
            "residual": MIRRORED_MOTION,
            "velocity": MIRRORED_MOTION,
        }
        tensors = {name: tensor.clone() for name, tensor in vars(self).items()}
        for name, columns in flipped.items():
            tensors[name][..., list(columns)] *= -1.0
        return type(self)(**tensors)

    def and_then(self, *others: Self) -> Self:
        """Return these examples and others."""
        joined = {
            name: torch.cat([tensor, *(getattr(other, name) for other in others)])
            for name, tensor in vars(self).items()
        }
        return type(self)(**joined)


def make_examples(
    data: Part,
    prior: Model,
    values: Values | None = None,
    network: NetworkConfig = NetworkConfig(),
) -> Examples:
    """Return inputs and outputs for these transitions on a prior.

    `values` (M,) are those of the prior's parameters that differ from its settings. `network` says
    which features there are.
    """
    prior_here = prior.with_bodies(data.bodies)
    physics_next = step_knowing(prior_here, data.state, data.action, values)
    frames = push_frames(data.state, data.action, data.bodies)
    features = network_inputs(network, data.state, frames, physics_next, data.bodies, values)
    velocity = data.next_state[..., VELOCITY] - physics_next[..., VELOCITY]
    targets = (true_residual(data.next_state, frames, physics_next), velocity)
    told = (torch.from_numpy(array.astype(np.float32)) for array in targets)
    return Examples(*features.tensors(), *told)


def inferred_values(data: Part, kind: Kind, random: np.random.Generator | None = None) -> Values:
    """Return values (M,) of a kind's parameters that other pushes of an episode show, by name.

    From all of them; with `random` from so many of the latest earlier ones as it draws. Values that
    the data give are as given.
    """
    known = Known.others(data.episode)
    if random is not None:
        earlier = Known.earlier(data.episode, data.step).counts
        known = Known.earlier(data.episode, data.step, random.integers(earlier + 1))
    return grid_values(kind, data.observed, known)[0] | dict(data.given or {})
