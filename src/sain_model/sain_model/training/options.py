"""What ``ros2 run sain_model train`` can be asked for."""

import argparse
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import tyro

from sain_core.errors import ConfigError
from sain_core.provenance import ros2_command
from sain_model.dynamics.rollouts import RolloutConfig
from sain_model.training.fine_tuning import Parent
from sain_model.training.presets import PRESETS
from sain_model.training.trainer import TrainingConfig

DEFAULT: Final = "default"


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
