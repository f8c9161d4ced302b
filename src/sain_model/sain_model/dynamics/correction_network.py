"""The network that corrects physical parameters, and the residual of the prediction."""

from typing import Final

import torch
from jaxtyping import Float
from torch import Tensor, nn

from sain_model.dynamics.corrections import CORRECTIONS, DRAG
from sain_model.dynamics.settings import CorrectionNetworkConfig
from sain_model.network.features import count_features
from sain_model.network.inputs import PLACE_FEATURES, TURN_SCALE
from sain_model.network.interaction_network import OUTPUTS, POSITION_UNIT, sum_messages
from sain_model.network.members import make_perceptron, zero_last_layer

BEFORE: Final = slice(-PLACE_FEATURES, 2 - PLACE_FEATURES)  # a body's place in the world
AFTER: Final = slice(2 - PLACE_FEATURES, 4 - PLACE_FEATURES)
MAP_SCALE: Final = 2.0  # of the map's part in DRAG
MAP_FINENESS: Final = 3.0  # its first layer starts out so much steeper than usual


class CorrectionNetwork(nn.Module):
    """f_rel and f_dyn as in `InteractionNetwork`, and one map of the table for all bodies.

    What a place does to a disk is the same for every disk that comes by: the map is a function of
    place alone, read along the straight line from where a disk stands to where the uncorrected
    prior predicts it. Its mean goes into `DRAG`, and all of it into f_dyn.
    """

    way: Tensor

    def __init__(self, config: CorrectionNetworkConfig = CorrectionNetworkConfig()) -> None:
        """Build it so that it starts out by leaving the prior as it is."""
        super().__init__()
        self.config = config
        of_body, of_relation = count_features(config.seen)
        inputs = of_body + config.message + config.places
        size = config.hidden, config.layers
        self.relation = make_perceptron(of_relation, config.message, *size)
        self.dynamics = make_perceptron(inputs, CORRECTIONS + OUTPUTS, *size)
        zero_last_layer(self.dynamics)
        if config.places:
            self.map = make_perceptron(2, 1, *size)
            first = self.map[0]
            assert isinstance(first, nn.Linear)
            nn.init.uniform_(first.weight, -MAP_FINENESS / 2**0.5, MAP_FINENESS / 2**0.5)
            zero_last_layer(self.map)
            self.register_buffer("way", torch.linspace(0, 1, config.places), persistent=False)
        self.register_buffer(
            "unit", torch.tensor([POSITION_UNIT, POSITION_UNIT, TURN_SCALE]), persistent=False
        )

    def forward(
        self, bodies: Float[Tensor, "B N D"], relations: Float[Tensor, "B E R"]
    ) -> tuple[Float[Tensor, "B N C"], Float[Tensor, "B N 3"]]:
        """Return corrections (`dynamics.corrections`) and the residual of what comes of them.

        Features are in the frame of the world.
        """
        inputs = [bodies, sum_messages(self.relation, relations, bodies.shape[1])]
        if self.config.places:
            inputs.append(self._look_up(bodies))
        output = self.dynamics(torch.cat(inputs, dim=-1))
        corrections, residual = output[..., :CORRECTIONS], output[..., CORRECTIONS:] * self.unit
        if self.config.places:
            drag = torch.zeros_like(corrections)
            drag[..., DRAG] = MAP_SCALE * inputs[-1].mean(dim=-1)
            corrections = corrections + drag
        return corrections, residual

    def _look_up(self, bodies: Float[Tensor, "B N D"]) -> Float[Tensor, "B N P"]:
        """Return the map along the way of each disk."""
        before, after = bodies[..., None, BEFORE], bodies[..., None, AFTER]
        along: Tensor = self.map(before + self.way[:, None] * (after - before))
        return along.squeeze(-1)


class CorrectionEnsemble(nn.ModuleList):
    """Several networks, each trained from a seed of its own."""

    def __init__(self, config: CorrectionNetworkConfig = CorrectionNetworkConfig()) -> None:
        """Build all of them."""
        super().__init__(CorrectionNetwork(config) for _ in range(config.members))
        self.config = config
