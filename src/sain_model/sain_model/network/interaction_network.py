"""The interaction network of the paper's section II-C: f_rel over pairs, f_dyn over bodies."""

from collections.abc import Sequence
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from sain_core.seeding import generator
from sain_model.network.features import count_features
from sain_model.network.inputs import GAP_AFTER, GAP_BEFORE, TURN_SCALE
from sain_model.network.members import make_perceptron, zero_last_layer
from sain_model.network.settings import NetworkConfig

OUTPUTS = 3  # dx, dy, dtheta
CHUNK = 512  # pushes at a time in an ensemble: what all its members make of them fits the cache
POSITION_UNIT = 0.005  # [m], an output of 1; dtheta counts in TURN_SCALE


class InteractionNetwork(nn.Module):
    """Predicts what the prior gets wrong, for each of any number of bodies.

    It may be an ensemble: M networks side by side, whose mean it predicts.
    """

    def __init__(self, config: NetworkConfig = NetworkConfig()) -> None:
        """Build it so that it starts out by leaving the prior as it is."""
        super().__init__()
        self.config = config
        size = config.hidden, config.layers, config.members
        of_body, of_relation = count_features(config)
        self.relation = make_perceptron(of_relation, config.message, *size)
        self.dynamics = make_perceptron(of_body + config.message, OUTPUTS, *size)
        zero_last_layer(self.dynamics)
        self.register_buffer(
            "unit", torch.tensor([POSITION_UNIT, POSITION_UNIT, TURN_SCALE]), persistent=False
        )

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
        effects = sum_messages(self.relation, relations, bodies.shape[2])
        output: Tensor = self.dynamics(torch.cat([bodies, effects], dim=-1)) * self.unit
        return output


def sum_messages(
    perceptron: nn.Module, relations: Float[Tensor, "*B E R"], bodies: int
) -> Float[Tensor, "*B N F"]:
    """Return what each body is told by the others, and by the tool.

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
