"""How weights descend: the optimiser and its learning rate, ours and the paper's."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from sain_core.config import Config, option

ADAMW: Final = "adamw"
ADAM: Final = "adam"
COSINE: Final = "cosine"
HALVING_STEPS: Final = "halving_steps"
HALVING_EPOCHS: Final = "halving_epochs"


@dataclass(frozen=True)
class DescentConfig(Config):
    """The optimiser, and how its learning rate falls."""

    optimiser: str = option(
        ADAMW,
        "adamw shrinks weights apart from the loss; adam adds equation 5's L2 term to it, with"
        " lambda half of weight_decay",
        choices=(ADAMW, ADAM),
    )
    schedule: str = option(
        COSINE,
        "the learning rate falls along a cosine to 0, or by half every so many steps or epochs",
        choices=(COSINE, HALVING_STEPS, HALVING_EPOCHS),
    )
    halving: int = option(2500, "steps or epochs after which it is halved", minimum=1)

    def rate(self, epoch: int, epochs: int, step: int) -> float:
        """Return the share of the first learning rate, at an epoch of so many and a step."""
        if self.schedule == COSINE:
            return 0.5 * (1.0 + math.cos(math.pi * epoch / epochs))
        done = step if self.schedule == HALVING_STEPS else epoch
        return float(0.5 ** (done // self.halving))

    def make(
        self, parameters: Iterable[Tensor], rate: float, weight_decay: float
    ) -> torch.optim.Optimizer:
        """Return the optimiser of these parameters."""
        kind = torch.optim.AdamW if self.optimiser == ADAMW else torch.optim.Adam
        return kind(parameters, rate, weight_decay=weight_decay)
