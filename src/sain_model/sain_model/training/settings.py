"""Settings of all trainings, importable without PyTorch."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from sain_core.config import Config, option
from sain_core.dataset import SHARES, TEST, VALIDATION
from sain_model.dynamics.settings import PLANAR, CorrectionNetworkConfig, LossConfig
from sain_model.network.settings import BOOTSTRAP, ORDER, PUSH_FRAME, NetworkConfig

if TYPE_CHECKING:
    import torch
    from torch import Tensor

ADAMW: Final = "adamw"
ADAM: Final = "adam"
COSINE: Final = "cosine"
HALVING_STEPS: Final = "halving_steps"
HALVING_EPOCHS: Final = "halving_epochs"


@dataclass(frozen=True)
class OptimizerConfig(Config):
    """The optimizer, and how its learning rate falls."""

    optimizer: str = option(
        ADAMW,
        "adamw: decoupled weight decay; adam: equation 5's L2 term with lambda = weight_decay / 2",
        choices=(ADAMW, ADAM),
    )
    schedule: str = option(
        COSINE,
        "learning rate schedule: a cosine to 0, or halving after a number of steps or epochs",
        choices=(COSINE, HALVING_STEPS, HALVING_EPOCHS),
    )
    halving: int = option(2500, "steps or epochs after which it is halved", minimum=1)

    def rate(self, epoch: int, epochs: int, step: int) -> float:
        """Return the share of the first learning rate, at an epoch of so many and a step."""
        if self.schedule == COSINE:
            return cosine(epoch, epochs)
        done = step if self.schedule == HALVING_STEPS else epoch
        return float(0.5 ** (done // self.halving))

    def make(
        self, parameters: "Iterable[Tensor]", rate: float, weight_decay: float
    ) -> "torch.optim.Optimizer":
        """Return the optimizer of these parameters."""
        import torch

        kind = torch.optim.AdamW if self.optimizer == ADAMW else torch.optim.Adam
        return kind(parameters, rate, weight_decay=weight_decay)


def cosine(done: int, total: int) -> float:
    """Return the share of the first learning rate when so much of a training is done."""
    return 0.5 * (1.0 + math.cos(math.pi * done / total))


NOTHING: Final = "none"
EARLIER: Final = "earlier"
EPISODE: Final = "episode"


@dataclass(frozen=True)
class DataConfig(Config):
    """What a network learns from."""

    seed: int = option(0, "seed; the same seed, data and settings give the same weights", minimum=0)
    validation: float = option(
        SHARES[VALIDATION],
        "share of the episodes that select the best epoch",
        minimum=0.01,
        maximum=0.5,
    )
    test: float = option(
        SHARES[TEST],
        "share of the episodes held out for the test; 0: none",
        minimum=0.0,
        maximum=0.5,
    )
    transitions: int = option(0, "number of training transitions; 0: all", minimum=0)
    prior_friction: float = option(
        0.12, "nominal friction of the planar prior", minimum=0.01, maximum=1.0
    )


@dataclass(frozen=True)
class TrainingConfig(DataConfig):
    """How a network is trained."""

    epochs: int = option(40, "passes over the data", minimum=1)
    epoch_steps: int = option(0, "steps in an epoch; 0: as many as one pass takes", minimum=0)
    validate_every: int = option(1, "epochs between validations", minimum=1)
    patience: int = option(
        0, "epochs without a better validation loss after which training stops; 0: never", minimum=0
    )
    batch: int = option(128, "pushes in an optimizer step", minimum=1)
    learning_rate: float = option(2e-3, "learning rate at the start", minimum=1e-7)
    weight_decay: float = option(
        0.1, "weight decay of the optimizer, the paper's lambda", minimum=0.0
    )
    diversity: str = option(
        ORDER,
        "data of each member: all pushes in another order, or episodes drawn with replacement",
        choices=(ORDER, BOOTSTRAP),
    )
    mirror: bool = option(True, "train on mirror images too; not with features of the world")
    prior: str = option(PLANAR, "model that is corrected: a name in the registry of models")
    history: str = option(
        EPISODE,
        "pushes that the friction is inferred from in training: none, the episode's earlier ones,"
        " or all its others; only for planar priors",
        choices=(NOTHING, EARLIER, EPISODE),
    )
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()
    optimizer: OptimizerConfig = OptimizerConfig()

    @property
    def mirrors(self) -> bool:
        """Whether mirror images are learned from: a tilted table in a mirror is another table."""
        return self.mirror and self.network.features == PUSH_FRAME


@dataclass(frozen=True)
class CorrectionTrainingConfig(DataConfig):
    """How a network that corrects parameters is trained."""

    steps: int = option(3000, "steps of the optimizer in all epochs", minimum=1)
    batch: int = option(64, "pushes in an optimizer step", minimum=1)
    learning_rate: float = option(
        2e-3, "learning rate at the start; it falls to 0 along a cosine", minimum=1e-7
    )
    weight_decay: float = option(0.01, "weight decay of AdamW", minimum=0.0)
    max_grad_norm: float = option(
        50.0, "largest norm of a gradient; longer ones are scaled to it", minimum=1e-3
    )
    epochs: int = option(
        20, "parts of the steps; validation after each chooses the best weights", minimum=1
    )
    history: str = option(
        NOTHING,
        "pushes that the friction is inferred from: none, or in training the episode's others and"
        " later its earlier ones",
        choices=(NOTHING, EPISODE),
    )
    network: CorrectionNetworkConfig = CorrectionNetworkConfig()
    loss: LossConfig = LossConfig()
