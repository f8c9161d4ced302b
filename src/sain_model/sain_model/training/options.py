"""The options of ``ros2 run sain_model train``, and its presets: ours, and the paper's.

The paper (section III-C): Adam at 0.001, halved every 2,500 steps, 8,000 epochs of batches of 16,
validated every 500 epochs on 20 % of the data, the best kept; 10 % in section III-B; equation 5
adds lambda |theta|^2. It gives neither lambda nor the scales of the loss: ours stand here.
With 3,000 transitions an epoch is 188 steps, so that the learning rate is halved every 13 of the
8,000 epochs and is nothing long before the first validation: either the steps are epochs, or the
epochs are steps. See docs/training.md.
"""

import argparse
from dataclasses import dataclass, field, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Final, Literal

import tyro

from sain_core.errors import ConfigError
from sain_core.provenance import ros2_command
from sain_model.dynamics.loss import LossConfig
from sain_model.dynamics.rollouts import RolloutConfig
from sain_model.training.fine_tuning import Parent
from sain_model.training.push_training import NOTHING, TrainingConfig
from sain_model.training.training_loop import ADAM, HALVING_EPOCHS, HALVING_STEPS, OptimizerConfig

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
class TrainCommand:
    """What to learn from, and where to."""

    dataset: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Shards *.npz or folders of them, one or more, also with different numbers of disks."""
    out: Path
    """Folder for checkpoint, card, loss curve and settings. Run again to go on after a stop."""
    name: str = "sain"
    """Name of the checkpoint."""
    parent: Annotated[str | None, tyro.conf.arg(name="from", metavar="CHECKPOINT")] = None
    """Go on with a checkpoint: sain (the shipped one), or a path; its settings stay."""
    preset: Literal["default", "paper", "paper-epochs", "paper-steps"] = "default"
    """Settings to start from: ours, or the paper's in one of its readings (docs/training.md)."""
    tensorboard: bool = False
    """Write the losses for TensorBoard too; needs the extra sain_model[tensorboard]."""
    training: TrainingConfig = TrainingConfig()
    rollout: RolloutConfig = RolloutConfig()


def parse(arguments: list[str] | None = None, about: str | None = None) -> TrainCommand:
    """Return what a command line asks for.

    What it says itself goes before its preset, and before the settings of the checkpoint that it
    goes on with.

    Raises:
        CheckpointError: that checkpoint is not sound.
        ConfigError: what it says contradicts the checkpoint.
    """
    scout = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    scout.add_argument("--preset", default=DEFAULT)
    scout.add_argument("--from", dest="parent")
    scouted = scout.parse_known_args(arguments)[0]
    parent = Parent.load(scouted.parent) if scouted.parent else None
    usual = parent.settings if parent else PRESETS.get(scouted.preset, TrainingConfig())
    command: TrainCommand = tyro.cli(
        make_dataclass(
            "TrainCommand",
            [("training", TrainingConfig, field(default=usual))],
            bases=(TrainCommand,),
            frozen=True,
        ),
        prog="train",
        description=about,
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    if parent:
        _check(command, parent)
    return command


def _check(command: TrainCommand, parent: Parent) -> None:
    parent.check_settings(command.training)
    if command.preset != DEFAULT:
        raise ConfigError(f"--preset {command.preset} is for new weights; leave it or --from out")
    if command.rollout.wanted:
        raise ConfigError("--steps-ahead is for new weights; leave it or --from out")


def command_line() -> str:
    """Return the command line of this process."""
    return ros2_command("sain_model", "train")
