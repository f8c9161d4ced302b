"""Options of ``ros2 run sain_model train``; they load without PyTorch."""

import argparse
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import tyro

from sain_core.config import Config, option, required
from sain_core.errors import ConfigError
from sain_model.dynamics.settings import RolloutConfig
from sain_model.training.presets import PRESETS
from sain_model.training.settings import TrainingConfig

DEFAULT: Final = "default"


@dataclass(frozen=True)
class TrainOptions(Config):
    """Train the interaction network on the residual of a prior, or go on with a checkpoint.

    The same command continues after a stop.
    """

    dataset: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "shards *.npz or folders of them, one or more, also with different numbers of disks"
    )
    out: Path = required("folder for checkpoint, card, loss curve and settings")
    name: str = option("sain", "name of the checkpoint")
    parent: Annotated[str | None, tyro.conf.arg(name="from", metavar="CHECKPOINT")] = option(
        None, "go on with a checkpoint: sain (the shipped one), or a path; its settings stay"
    )
    preset: Literal["default", "paper", "paper-epochs", "paper-steps"] = option(
        "default", "settings to start from: ours, or the paper's in one reading (docs/training.md)"
    )
    tensorboard: bool = option(
        False, "write the losses for TensorBoard too; needs the extra sain_model[tensorboard]"
    )
    training: TrainingConfig = TrainingConfig()
    rollout: RolloutConfig = RolloutConfig()


def train_options(arguments: list[str]) -> type[TrainOptions]:
    """Return the options with the defaults that ``--preset`` and ``--from`` of arguments give.

    Raises:
        CheckpointError: the checkpoint of ``--from`` is not sound.
    """
    scout = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    scout.add_argument("--preset", default=DEFAULT)
    scout.add_argument("--from", dest="parent")
    try:
        scouted = scout.parse_known_args(arguments)[0]
    except argparse.ArgumentError:
        return TrainOptions  # which reports it
    usual = PRESETS.get(scouted.preset, TrainingConfig())
    if scouted.parent:
        from sain_model.training.fine_tuning import Parent  # loads PyTorch

        usual = Parent.load(scouted.parent).settings
    return make_dataclass(
        "TrainOptions",
        [("training", TrainingConfig, field(default=usual))],
        bases=(TrainOptions,),
        frozen=True,
        namespace={"__doc__": TrainOptions.__doc__},
    )


def check_parent(options: TrainOptions) -> None:
    """Check that options do not contradict the checkpoint that they go on with.

    Raises:
        ConfigError: naming the option.
    """
    if options.preset != DEFAULT:
        raise ConfigError(f"--preset {options.preset} is for new weights; leave it or --from out")
    if options.rollout.wanted:
        raise ConfigError("--steps-ahead is for new weights; leave it or --from out")
