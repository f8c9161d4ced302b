"""The options of ``train`` and ``train_correction``, and presets: ours, and the paper's.

The paper (section III-C): Adam at 0.001, halved every 2,500 steps, 8,000 epochs of batches of 16,
validated every 500 epochs on 20 % of the data, the best kept; 10 % in section III-B; equation 5
adds lambda |theta|^2. It gives neither lambda nor the scales of the loss: ours stand here.
With 3,000 transitions an epoch is 188 steps, so that the learning rate is halved every 13 of the
8,000 epochs and is nothing long before the first validation: either the steps are epochs, or the
epochs are steps. See docs/guides/training.md. This module loads without PyTorch.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final, Literal

import tyro

from sain_core.config import Config, option, required
from sain_model.dynamics.settings import PLANAR, PLANAR_AXES, LossConfig, RolloutConfig
from sain_model.training.settings import (
    ADAM,
    HALVING_EPOCHS,
    HALVING_STEPS,
    NOTHING,
    CorrectionTrainingConfig,
    OptimizerConfig,
    TrainingConfig,
)

DEFAULT: Final = "default"
LAMBDA: Final = 1e-6  # of equation 5, of a loss in units of 1 mm

PAPER: Final = TrainingConfig(
    epochs=8000,
    validate_every=500,
    batch=16,
    learning_rate=1e-3,
    weight_decay=2 * LAMBDA,  # the gradient of lambda |theta|^2
    mirror=False,
    validation=0.2,
    history=NOTHING,
    loss=LossConfig(robust=False, position_scale=0.001, velocity_scale=0.1, heading_scale=0.05),
    optimizer=OptimizerConfig(ADAM, HALVING_STEPS, 2500),
)
PAPER_EPOCHS: Final = replace(PAPER, optimizer=OptimizerConfig(ADAM, HALVING_EPOCHS, 2500))
PAPER_STEPS: Final = replace(PAPER, epochs=16, epoch_steps=500, validate_every=1)
"""8,000 steps, validated every 500 of them."""

PRESETS: Final = {
    "default": TrainingConfig(),
    "paper": PAPER,
    "paper-epochs": PAPER_EPOCHS,
    "paper-steps": PAPER_STEPS,
}


@dataclass(frozen=True)
class TrainOptions(Config):
    """Train the interaction network on the residual of a prior, or go on with a checkpoint.

    The same command continues after a stop.
    """

    dataset: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "shards *.npz or folders of them, one or more, also with different bodies"
    )
    out: Path = required("folder for checkpoint, card, loss curve and settings")
    name: str = option("sain", "name of the checkpoint")
    parent: Annotated[str | None, tyro.conf.arg(name="from", metavar="CHECKPOINT")] = option(
        None,
        "go on with a checkpoint: sain (shipped), or a path; its settings stay",
    )
    preset: Literal["default", "paper", "paper-epochs", "paper-steps"] = option(
        "default",
        "settings to start from: ours, or the paper's (docs/guides/training.md)",
    )
    belief: str = option(
        "",
        "file of `sain_model identify`: the network corrects the physics found there, not --prior;"
        " empty: none",
    )
    tensorboard: bool = option(
        False, "write the losses for TensorBoard too; needs the extra sain_model[tensorboard]"
    )
    training: TrainingConfig = TrainingConfig()
    rollout: RolloutConfig = RolloutConfig()


@dataclass(frozen=True)
class TrainCorrectionOptions(Config):
    """Train networks that correct the parameters of the planar prior for one laboratory.

    The same command continues after a stop.
    """

    dataset: Annotated[Path, tyro.conf.Positional] = required("a shard *.npz, or a folder of them")
    out: Path = required("folder for checkpoint, card and settings")
    name: str = option("correction", "name of the checkpoint")
    prior: str = option(
        PLANAR_AXES, "the prior whose parameters are corrected", choices=(PLANAR, PLANAR_AXES)
    )
    training: CorrectionTrainingConfig = CorrectionTrainingConfig()
