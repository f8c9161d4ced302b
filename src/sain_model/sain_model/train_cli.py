"""``ros2 run sain_model train``: learn the residual of a prior from collected transitions."""

import argparse
import json
import shlex
import sys
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
import tyro
from rich.console import Console

from sain_core.errors import ConfigError, DatasetError
from sain_core.storage import write_whole
from sain_model.checkpoint import Card, save_checkpoint
from sain_model.command import carry_out
from sain_model.dataset import Split, Transitions, limit_training
from sain_model.environment import environment
from sain_model.epoch_bar import EpochBar
from sain_model.error_table import error_table, history_table, interval_table
from sain_model.event_log import EventLog
from sain_model.held_out import held_out_errors
from sain_model.interval_fit import fit_intervals
from sain_model.load import prior_settings, sain_class
from sain_model.loss_plot import save_loss_curve
from sain_model.mixed import MixedSplit, MixedTransitions, load_datasets, split_datasets
from sain_model.network import ON_STATE
from sain_model.presets import PRESETS
from sain_model.rollout_training import RolloutTrainer
from sain_model.rollouts import RolloutConfig
from sain_model.sain import SainDynamics
from sain_model.training import Trainer, TrainingConfig, prior_and_filter
from sain_model.training_state import History


@dataclass(frozen=True)
class TrainCommand:
    """What to learn from, and where to."""

    dataset: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Shards *.npz or folders of them, one or more, also with different numbers of disks."""
    out: Path
    """Folder for checkpoint, card, loss curve and settings. Run again to go on after a stop."""
    name: str = "sain"
    """Name of the checkpoint."""
    preset: Literal["default", "paper", "paper-epochs", "paper-steps"] = "default"
    """Settings to start from: ours, or the paper's in one of its readings (docs/training.md)."""
    tensorboard: bool = False
    """Write the losses for TensorBoard too; needs the extra sain_model[tensorboard]."""
    training: TrainingConfig = TrainingConfig()
    rollout: RolloutConfig = RolloutConfig()


def main(arguments: list[str] | None = None) -> int:
    """Train the interaction network on the residual of a prior."""
    torch.set_num_threads(1)
    command = parse(arguments)
    return carry_out(lambda console: train(command, console), "epoch")


def parse(arguments: list[str] | None = None) -> TrainCommand:
    """Return what a command line asks for; what it says itself goes before its preset."""
    scout = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    scout.add_argument("--preset", default="default")
    preset = scout.parse_known_args(arguments)[0].preset
    training = field(default=PRESETS.get(preset, TrainingConfig()))
    return tyro.cli(
        make_dataclass(
            "TrainCommand",
            [("training", TrainingConfig, training)],
            bases=(TrainCommand,),
            frozen=True,
        ),
        prog="train",
        description=main.__doc__,
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )


def train(command: TrainCommand, console: Console) -> Path:
    """Train, evaluate on the held-out episodes, write everything; return the checkpoint's path.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    config = command.training
    data = load_datasets(command.dataset)
    split = split_datasets(data, config.seed, config.validation, config.test)
    if config.transitions:
        split = limit_training(split, config.transitions)
    learned = learn(command, data, split, console)
    sain, history = learned.sain, learned.history
    errors = held_out_errors(split, sain)
    card = make_card(command, data, split, learned, errors)
    path = command.out / f"{command.name}.safetensors"
    save_checkpoint(path, sain.network, card)
    for part in ("all", "target_moved"):
        console.print(error_table(errors, part))
    console.print(history_table(errors))
    for intervals in errors["intervals"].values():
        console.print(interval_table(intervals))
    console.print(f"{path}: epoch {history.best + 1} of {len(history.train)}")
    return path


@dataclass(frozen=True)
class Learned:
    """What a training gives.

    Attributes:
        sain: the model, with the regions of its predictions.
        history: losses on single pushes.
        rollouts: losses on rollouts afterwards; None: it did not learn from any.
    """

    sain: SainDynamics
    history: History
    rollouts: History | None


def learn(
    command: TrainCommand,
    data: Transitions | MixedTransitions,
    split: Split | MixedSplit,
    console: Console,
) -> Learned:
    """Train on single pushes, then on rollouts if wanted, and fit the regions of predictions."""
    config = command.training
    rollouts = command.rollout if command.rollout.wanted else None
    if rollouts and not isinstance(split, Split):
        raise DatasetError("--steps-ahead needs data with one number of disks")
    if rollouts and config.network.residual == ON_STATE:
        raise ConfigError("--steps-ahead learns residuals on physics; leave --residual state out")
    prior, friction = prior_and_filter(config, split.train)
    trainer = Trainer(split, prior, config, command.out, friction)
    write_whole(command.out / "config.json", _settings(command, data).encode())
    _run(trainer, command, console)
    save_loss_curve(command.out / "loss.png", trainer.history)
    after = None
    if rollouts and isinstance(split, Split):
        learner = RolloutTrainer(
            trainer.network, split, prior, rollouts, config, command.out, friction
        )
        with EpochBar(console, rollouts.rollout_epochs, learner.epoch) as advance:
            learner.run(advance)
        save_loss_curve(command.out / "rollout_loss.png", learner.history)
        after = learner.history
    infers = friction.config if friction else None
    sain = sain_class(rollouts)(
        trainer.network, prior, config.prior, friction=infers, recurrent=rollouts is not None
    )
    intervals = fit_intervals(sain, split.validation.parts[0])
    return Learned(replace(sain, intervals=intervals), trainer.history, after)


def _run(trainer: Trainer, command: TrainCommand, console: Console) -> None:
    """Train to the end while the terminal, and TensorBoard where it is asked for, show it."""
    with ExitStack() as stack:
        followers = []
        if command.tensorboard:
            followers.append(stack.enter_context(EventLog(command.out, trainer.epoch)))
        bar = EpochBar(console, command.training.epochs, trainer.epoch)
        followers.append(stack.enter_context(bar))

        def advance(epoch: int, history: History) -> None:
            for follow in followers:
                follow(epoch, history)

        trainer.run(advance)


def make_card(
    command: TrainCommand,
    data: Transitions | MixedTransitions,
    split: Split | MixedSplit,
    learned: Learned,
    errors: dict[str, Any],
) -> Card:
    """Return the card of what was trained."""
    config, sain = command.training, learned.sain
    parts = {"train": split.train, "validation": split.validation, "test": split.test}
    training = {**asdict(config), **_losses(learned.history)}
    if learned.rollouts:
        training["rollouts"] = _losses(learned.rollouts)
    return Card(
        prior=config.prior,
        prior_config=prior_settings(sain.prior),
        network=asdict(config.network),
        friction=asdict(sain.friction) if sain.friction else None,
        intervals=asdict(sain.intervals) if sain.intervals else None,
        kind=sain.kind,
        rollouts=asdict(command.rollout) if sain.recurrent else None,
        data={
            "path": " ".join(map(str, command.dataset)),
            "sha256": data.sha256,
            "sources": list(data.sources),
            "transitions": {name: len(part) for name, part in parts.items()},
            "episodes": {name: len(np.unique(part.episodes)) for name, part in parts.items()},
        },
        training=training,
        errors=errors,
        versions=environment(),
        command=_command_line(),
    )


def _losses(history: History) -> dict[str, float]:
    return {
        "epochs_done": len(history.train),
        "best_epoch": history.best + 1,
        "train_loss": history.train[history.best],
        "validation_loss": history.validation[history.best],
    }


def _settings(command: TrainCommand, data: Transitions | MixedTransitions) -> str:
    """Return what is to be done with what, as it stands beside the checkpoint from the start."""
    settings = {
        **asdict(command),
        "data_sha256": data.sha256,
        "environment": environment(),
        "command": _command_line(),
    }
    return json.dumps(settings, indent=2, default=str) + "\n"


def _command_line() -> str:
    return shlex.join(["ros2", "run", "sain_model", "train", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
