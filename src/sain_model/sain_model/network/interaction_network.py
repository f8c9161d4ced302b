"""The interaction network of the paper's section II-C: f_rel over pairs, f_dyn over bodies.

In PyTorch, for training; `network.network_kernels` predicts.
"""

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Self

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from sain_core.randomness import generator
from sain_model.network.feature_kernels import GAP_AFTER, GAP_BEFORE
from sain_model.network.features import (
    Features,
    count_features,
)
from sain_model.network.network_kernels import OUTPUTS
from sain_model.network.settings import NetworkConfig
from sain_model.network.weights import UNIT, NetworkWeights

CHUNK: Final = 512  # pushes at a time: what all members make of them fits the cache


class MemberLinear(nn.Module):
    """A linear layer for each of M members, in one batched product.

    Attributes:
        weight: (M, outputs, inputs); a member's are drawn as those of `torch.nn.Linear` are.
        bias: (M, outputs).
    """

    def __init__(self, members: int, inputs: int, outputs: int) -> None:
        super().__init__()
        layers = [nn.Linear(inputs, outputs) for _ in range(members)]
        self.weight = nn.Parameter(torch.stack([layer.weight.detach() for layer in layers]))
        self.bias = nn.Parameter(torch.stack([layer.bias.detach() for layer in layers]))

    def forward(self, inputs: Float[Tensor, "M *B I"]) -> Float[Tensor, "M *B O"]:
        """Apply each member's layer to its own inputs."""
        rows = inputs.flatten(1, -2)  # (M, rows, I)
        outputs = torch.baddbmm(self.bias.unsqueeze(1), rows, self.weight.transpose(1, 2))
        return outputs.unflatten(1, inputs.shape[1:-1])


class InteractionNetwork(nn.Module):
    """Predicts what the prior gets wrong, for each of any number of bodies.

    It may be an ensemble: M networks side by side, whose mean it predicts.
    """

    unit: Tensor

    def __init__(self, config: NetworkConfig = NetworkConfig()) -> None:
        """Build it so that it starts out by leaving the prior as it is."""
        super().__init__()
        self.config = config
        size = config.hidden, config.layers, config.members
        of_body, of_relation = count_features(config)
        self.relation = _perceptron(of_relation, config.message, *size)
        self.dynamics = _perceptron(of_body + config.message, OUTPUTS, *size)
        for parameter in self.dynamics[-1].parameters():
            nn.init.zeros_(parameter)
        self.register_buffer("unit", torch.tensor(UNIT), persistent=False)

    @classmethod
    def of(cls, weights: NetworkWeights) -> Self:
        """Return a network with these weights."""
        network = cls(weights.config)
        tensors = {name: torch.from_numpy(array) for name, array in weights.tensors.items()}
        network.load_state_dict(tensors)
        return network.eval()

    @property
    def weights(self) -> NetworkWeights:
        """The weights as they are now."""
        state = self.state_dict().items()
        arrays = {name: np.array(tensor.cpu().numpy()) for name, tensor in state}
        return NetworkWeights(self.config, arrays)

    def forward(
        self, bodies: Float[Tensor, "B N D"], relations: Float[Tensor, "B E R"]
    ) -> Float[Tensor, "B N 3"]:
        """Return the residual of each body: dx, dy [m] in the push frame, dtheta [rad]."""
        if self.config.members == 1:
            return self.each(bodies, relations)[0]
        parts = zip(bodies.split(CHUNK), relations.split(CHUNK), strict=True)
        return torch.cat([self.each(*part).mean(dim=0) for part in parts])

    def each(
        self, bodies: Float[Tensor, "*M B N D"], relations: Float[Tensor, "*M B E R"]
    ) -> Float[Tensor, "M B N 3"]:
        """Return every member's residual, of the same inputs or each of its own (M, ...)."""
        if bodies.ndim == 3:
            bodies = bodies.expand(self.config.members, *bodies.shape)
            relations = relations.expand(self.config.members, *relations.shape)
        messages = sum_messages(self.relation, relations, bodies.shape[2])
        output: Tensor = self.dynamics(torch.cat([bodies, messages], dim=-1))
        return output * self.unit


def as_tensors(features: Features) -> tuple[Float[Tensor, "B N D"], Float[Tensor, "B E R"]]:
    """Return features of bodies and of relations as PyTorch's networks take them."""
    bodies, relations = (torch.from_numpy(array.astype(np.float32)) for array in features)
    return bodies, relations


def sum_messages(
    perceptron: nn.Module, relations: Float[Tensor, "*B E R"], bodies: int
) -> Float[Tensor, "*B N F"]:
    """Return the messages to each body, of the others and of the tool, added up.

    Bodies far apart send no messages, so that more of them change nothing either.
    """
    gaps = torch.minimum(relations[..., GAP_BEFORE], relations[..., GAP_AFTER])
    messages: Tensor = perceptron(relations) * (1.0 - gaps).unsqueeze(-1)
    return messages.unflatten(-2, (bodies, -1)).sum(dim=-2)


def new_network(config: NetworkConfig, seed: int) -> InteractionNetwork:
    """Return a network with weights drawn from a seed; each member's by themselves."""
    alone = replace(config, members=1)
    networks = []
    for member in range(config.members):
        path = ("weights",) if member == 0 else ("weights", "member", member)
        torch.manual_seed(int(generator(seed, *path).integers(2**31)))
        networks.append(InteractionNetwork(alone))
    return networks[0] if config.members == 1 else ensemble(networks)


def ensemble(networks: Sequence[InteractionNetwork]) -> InteractionNetwork:
    """Return the ensemble of networks of one size."""
    joined = InteractionNetwork(replace(networks[0].config, members=len(networks)))
    states = [network.state_dict() for network in networks]
    joined.load_state_dict({name: torch.stack([s[name] for s in states]) for name in states[0]})
    return joined


def _perceptron(inputs: int, outputs: int, hidden: int, layers: int, members: int) -> nn.Sequential:
    """Return a perceptron with so many hidden layers of this width, for one network or more."""
    linear = nn.Linear if members == 1 else functools.partial(MemberLinear, members)
    modules: list[nn.Module] = []
    for width in [inputs, *[hidden] * (layers - 1)]:
        modules += [linear(width, hidden), nn.SiLU()]
    return nn.Sequential(*modules, linear(hidden, outputs))
