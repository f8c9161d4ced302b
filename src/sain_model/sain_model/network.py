"""The interaction network of the paper's section II-C: f_rel over pairs, f_dyn over disks."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from sain_core.config import Config, option
from sain_model.features import (
    DISK_FEATURES,
    FRAMES,
    GAP_AFTER,
    GAP_BEFORE,
    PUSH_FRAME,
    RELATION_FEATURES,
    TURN_SCALE,
    WORLD_FRAME,
)
from sain_model.place_features import PLACE_FEATURES

OUTPUTS = 3  # dx, dy, dtheta
POSITION_UNIT = 0.005  # [m], an output of 1; dtheta counts in TURN_SCALE


@dataclass(frozen=True)
class NetworkConfig(Config):
    """The size of the network."""

    hidden: int = option(64, "width of the hidden layers", minimum=1, maximum=1024)
    message: int = option(32, "width of what one disk tells another", minimum=1, maximum=1024)
    layers: int = option(2, "hidden layers of f_rel and of f_dyn", minimum=1, maximum=6)
    features: str = option(
        PUSH_FRAME, "what it sees: scenes as the push sees them, or the world too", choices=FRAMES
    )

    @property
    def disk_features(self) -> int:
        """How many numbers it is told of each disk."""
        return DISK_FEATURES + (PLACE_FEATURES if self.features == WORLD_FRAME else 0)


class InteractionNetwork(nn.Module):
    """Predicts what the prior gets wrong, for each of any number of disks."""

    def __init__(self, config: NetworkConfig = NetworkConfig()) -> None:
        """Build it so that it starts out by leaving the prior as it is."""
        super().__init__()
        self.config = config
        self.relation = _perceptron(RELATION_FEATURES, config.message, config)
        self.dynamics = _perceptron(config.disk_features + config.message, OUTPUTS, config)
        last = self.dynamics[-1]
        assert isinstance(last, nn.Linear)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.register_buffer(
            "unit", torch.tensor([POSITION_UNIT, POSITION_UNIT, TURN_SCALE]), persistent=False
        )

    def forward(
        self, disks: Float[Tensor, "B N D"], relations: Float[Tensor, "B E R"]
    ) -> Float[Tensor, "B N 3"]:
        """Return the residual of each disk: dx, dy [m] in the push frame, dtheta [rad]."""
        batch, count, _ = disks.shape
        # Disks far apart tell each other nothing, so that more of them change nothing either.
        gaps = torch.minimum(relations[..., GAP_BEFORE], relations[..., GAP_AFTER])
        effects = self.relation(relations) * (1.0 - gaps).unsqueeze(-1)  # (B, E, message)
        effects = effects.view(batch, count, count - 1, -1).sum(dim=2)  # (B, N, message)
        output: Tensor = self.dynamics(torch.cat([disks, effects], dim=-1)) * self.unit
        return output


def _perceptron(inputs: int, outputs: int, config: NetworkConfig) -> nn.Sequential:
    modules: list[nn.Module] = []
    width = inputs
    for _ in range(config.layers):
        modules += [nn.Linear(width, config.hidden), nn.SiLU()]
        width = config.hidden
    return nn.Sequential(*modules, nn.Linear(width, outputs))
