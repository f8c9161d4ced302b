"""Settings of a training, importable without PyTorch, and presets: ours, and the paper's.

The paper (section III-C): Adam at 0.001, halved every 2,500 steps, 8,000 epochs of batches of 16,
validated every 500 epochs on 20 % of the data, the best kept; 10 % in section III-B; equation 5
adds lambda |theta|^2. It gives neither lambda nor the scales of the loss: ours stand here.
With 3,000 transitions an epoch is 188 steps, so that the learning rate is halved every 13 of the
8,000 epochs and is nothing long before the first validation: either the steps are epochs, or the
epochs are steps. See docs/guides/training.md.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

import tyro

from sain_core.config import MOST_SEED, Config, option, required
from sain_core.errors import ConfigError
from sain_core.output import OVERWRITE_HELP
from sain_core.transitions import SHARES, TEST, VALIDATION
from sain_model.network.settings import (
    BOOTSTRAP,
    EARLIER,
    ORDER,
    PLANAR,
    PUSH_FRAME,
    WORLD_FRAME,
    NetworkConfig,
)

if TYPE_CHECKING:
    import torch
    from torch import Tensor

ADAMW: Final = "adamw"
ADAM: Final = "adam"
COSINE: Final = "cosine"
HALVING_STEPS: Final = "halving_steps"
HALVING_EPOCHS: Final = "halving_epochs"
NOTHING: Final = "none"
EPISODE: Final = "episode"
OF_ROLLOUTS: Final = ("steps_ahead", "rollout_epochs")
ROLLOUT_BATCH: Final = 64  # windows in an optimizer step
ROLLOUT_RATE: Final = 1e-3  # learning rate at the start; it falls to 0 along a cosine
LAMBDA: Final = 1e-6  # of equation 5, of a loss in units of 1 mm


@dataclass(frozen=True)
class TrainingConfig(Config):
    """What a network learns from, and how: the loss is Algorithm 1's, line 17."""

    seed: int = option(
        0,
        "seed; the same seed, data and settings give the same weights",
        minimum=0,
        maximum=MOST_SEED,
    )
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
    prior: str = option(
        PLANAR,
        "model that is corrected: a name in the registry of models; identity: the network alone",
    )
    history: str = option(
        EPISODE,
        "what physics is inferred from in training, for planar priors: nothing; the friction from"
        " all other pushes of the episode; or all parameters from the earlier ones, as in use",
        choices=(NOTHING, EPISODE, EARLIER),
    )
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
    robust: bool = option(True, "Huber's loss: beyond a scale an error counts linearly")
    position_scale: float = option(0.001, "of position errors in the loss", unit="m", minimum=1e-6)
    velocity_scale: float = option(0.1, "of velocity errors in the loss", unit="m/s", minimum=1e-6)
    heading_scale: float = option(0.05, "of errors of sin and cos of the heading", minimum=1e-6)
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
    steps_ahead: int = option(
        1, "pushes of a training rollout; 1: single pushes only", minimum=1, maximum=100
    )
    rollout_epochs: int = option(12, "passes over the windows", minimum=1)
    network: NetworkConfig = NetworkConfig()

    def __post_init__(self) -> None:
        """Check the fields, and that rollouts know what is inferred."""
        super().__post_init__()
        if self.steps_ahead > 1 and self.history == EARLIER:
            raise ConfigError(
                f"history is {EARLIER!r}, and steps_ahead {self.steps_ahead}; rollouts infer the"
                f" friction alone: use history {EPISODE}, or steps_ahead 1"
            )

    @property
    def of_pushes(self) -> Self:
        """Settings for single pushes: the same whether rollouts follow or not."""
        usual: dict[str, Any] = {
            item.name: item.default for item in fields(self) if item.name in OF_ROLLOUTS
        }
        return replace(self, **usual)

    @property
    def of_rollouts(self) -> Self:
        """Settings for the rollouts that follow: seed, data, decay and loss stay."""
        return replace(
            self,
            epochs=self.rollout_epochs,
            epoch_steps=0,
            validate_every=1,
            patience=0,
            batch=ROLLOUT_BATCH,
            learning_rate=ROLLOUT_RATE,
            diversity=ORDER,
            optimizer=ADAMW,
            schedule=COSINE,
        )

    @property
    def mirrors(self) -> bool:
        """Whether mirror images are learned from: a tilted table in a mirror is another table."""
        return self.mirror and self.network.features == PUSH_FRAME

    def rate(self, epoch: int, step: int) -> float:
        """Return the learning rate at an epoch and a step."""
        if self.schedule == COSINE:
            share = 0.5 * (1.0 + math.cos(math.pi * epoch / self.epochs))
        else:
            done = step if self.schedule == HALVING_STEPS else epoch
            share = 0.5 ** (done // self.halving)
        return share * self.learning_rate

    def make_optimizer(self, parameters: "Iterable[Tensor]") -> "torch.optim.Optimizer":
        """Return the optimizer of these parameters."""
        import torch

        kind = torch.optim.AdamW if self.optimizer == ADAMW else torch.optim.Adam
        return kind(parameters, self.learning_rate, weight_decay=self.weight_decay)


PAPER: Final = TrainingConfig(
    epochs=8000,
    validate_every=500,
    batch=16,
    learning_rate=1e-3,
    weight_decay=2 * LAMBDA,  # the gradient of lambda |theta|^2
    mirror=False,
    validation=0.2,
    history=NOTHING,
    robust=False,
    optimizer=ADAM,
    schedule=HALVING_STEPS,
)
OF_BODIES: Final = TrainingConfig(  # of a belief in bodies that have names
    test=0.0,
    epochs=80,
    history=NOTHING,
    heading_scale=0.02,
    network=NetworkConfig(hidden=128, features=WORLD_FRAME, believed=True, members=4),
)
DEFAULT: Final = "default"
PRESETS: Final = {
    DEFAULT: TrainingConfig(),
    "paper": PAPER,
    "paper-epochs": replace(PAPER, schedule=HALVING_EPOCHS),
    # 8,000 steps, validated every 500 of them
    "paper-steps": replace(PAPER, epochs=16, epoch_steps=500, validate_every=1),
}


@dataclass(frozen=True)
class TrainOptions(Config):
    """Train the interaction network on what a prior leaves, or resume with a checkpoint.

    The same command continues after a stop.
    """

    dataset: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "shards *.npz or folders of them, one or more, also with different bodies"
    )
    out: Path = required("folder for checkpoint, card, loss curve and settings")
    name: str = option("sain", "name of the checkpoint")
    overwrite: bool = option(False, OVERWRITE_HELP)
    parent: Annotated[str | None, tyro.conf.arg(name="from", metavar="CHECKPOINT")] = option(
        None, "fine-tune a checkpoint: sain (shipped), or a path; its settings stay"
    )
    preset: Literal["default", "paper", "paper-epochs", "paper-steps"] = option(
        "default", "settings to start from: ours, or the paper's (docs/guides/training.md)"
    )
    belief: str = option(
        "",
        "file of `sain_model identify`: the network corrects the physics found there, not --prior;"
        " empty: none",
    )
    training: TrainingConfig = TrainingConfig()
