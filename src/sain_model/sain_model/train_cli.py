"""``ros2 run sain_model train``: learn the residual of a prior from collected transitions."""

import json
import platform
import shlex
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_core.dynamics import Dynamics
from sain_core.errors import SainError
from sain_model.checkpoint import Card, save_checkpoint, write_whole
from sain_model.dataset import (
    Split,
    Transitions,
    limit_training,
    load_transitions,
    split_by_episode,
)
from sain_model.error_table import error_table, history_table
from sain_model.evaluation import evaluate
from sain_model.friction import FrictionConfig, FrictionFilter
from sain_model.friction_noise import fit_noise
from sain_model.load import load_prior, prior_settings, sain_class
from sain_model.loss_plot import save_loss_curve
from sain_model.network import InteractionNetwork
from sain_model.open_loop import card_errors
from sain_model.planar import PlanarPrior
from sain_model.rollout_training import RolloutTrainer
from sain_model.rollouts import RolloutConfig
from sain_model.sain import IDENTITY, LEARNED, SainDynamics
from sain_model.training import NOTHING, History, Trainer, TrainingConfig


@dataclass(frozen=True)
class TrainCommand:
    """What to learn from, and where to."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A shard *.npz, or a folder of them."""
    out: Path
    """Folder for checkpoint, card, loss curve and settings. Run again to go on after a stop."""
    name: str = "sain"
    """Name of the checkpoint."""
    training: TrainingConfig = TrainingConfig()
    rollout: RolloutConfig = RolloutConfig()


def main(arguments: list[str] | None = None) -> int:
    """Train the interaction network on the residual of a prior."""
    torch.set_num_threads(1)
    console = Console()
    command = tyro.cli(
        TrainCommand,
        prog="train",
        description=main.__doc__,
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    try:
        train(command, console)
    except SainError as error:
        Console(stderr=True).print(f"[red]error:[/] {error}", highlight=False)
        return 1
    except KeyboardInterrupt:
        console.print("stopped; the same command goes on from the last whole epoch")
        return 130
    return 0


def train(command: TrainCommand, console: Console) -> Path:
    """Train, evaluate on the held-out episodes, write everything; return the checkpoint's path.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    config = command.training
    data = load_transitions(command.dataset)
    split = split_by_episode(data, config.seed, config.validation, config.test)
    if config.transitions:
        split = limit_training(split, config.transitions)
    write_whole(command.out / "config.json", _settings(command).encode())
    settings = {"friction": config.prior_friction} if config.prior != IDENTITY else None
    prior = load_prior(config.prior, settings)
    friction = None if config.history == NOTHING else make_filter(prior, split.train)
    trainer = Trainer(split, prior, config, command.out, friction)
    with EpochBar(console, config.epochs, trainer.epoch) as advance:
        trainer.run(advance)
    save_loss_curve(command.out / "loss.png", trainer.history)
    rollouts = command.rollout if command.rollout.wanted else None
    if rollouts:
        after = learn_rollouts(command, trainer.network, split, prior, friction, console)
    infers = friction.config if friction else None
    sain = sain_class(rollouts)(
        trainer.network, prior, config.prior, friction=infers, recurrent=rollouts is not None
    )
    errors = _errors(split.test, sain)
    card = make_card(command, data, split, trainer.history, errors, sain)
    if rollouts:
        card = replace(card, training={**card.training, "rollouts": _best_losses(after)})
    path = command.out / f"{command.name}.safetensors"
    save_checkpoint(path, trainer.network, card)
    for part in ("all", "target_moved"):
        console.print(error_table(errors, part))
    console.print(history_table(errors))
    console.print(f"{path}: epoch {trainer.history.best + 1} of {config.epochs}")
    return path


def learn_rollouts(
    command: TrainCommand,
    network: InteractionNetwork,
    split: Split,
    prior: Dynamics,
    friction: FrictionFilter | None,
    console: Console,
) -> History:
    """Go on with a network that has learned from single pushes; return the losses."""
    config, out = command.rollout, command.out
    trainer = RolloutTrainer(network, split, prior, config, command.training, out, friction)
    with EpochBar(console, config.rollout_epochs, trainer.epoch) as advance:
        trainer.run(advance)
    save_loss_curve(out / "rollout_loss.png", trainer.history)
    return trainer.history


def make_filter(prior: Dynamics, data: Transitions) -> FrictionFilter | None:
    """Return what infers friction for a prior, its noise fitted where the truth is known.

    None for a prior that knows no friction.
    """
    if not isinstance(prior, PlanarPrior):
        return None
    known = np.isfinite(data.friction).all()
    config = fit_noise(prior, data) if known else FrictionConfig()
    return FrictionFilter(prior, prior.config.friction, config)


def make_card(
    command: TrainCommand,
    data: Transitions,
    split: Split,
    history: History,
    errors: dict[str, Any],
    sain: SainDynamics,
) -> Card:
    """Return the card of what was trained."""
    config = command.training
    parts = {"train": split.train, "validation": split.validation, "test": split.test}
    return Card(
        prior=config.prior,
        prior_config=prior_settings(sain.prior),
        network=asdict(config.network),
        friction=asdict(sain.friction) if sain.friction else None,
        kind=sain.kind,
        rollouts=asdict(command.rollout) if sain.recurrent else None,
        data={
            "path": str(command.dataset),
            "sha256": data.sha256,
            "transitions": {name: len(part) for name, part in parts.items()},
            "episodes": {name: len(np.unique(part.episodes)) for name, part in parts.items()},
        },
        training={
            **asdict(config),
            **_best_losses(history),
        },
        errors=errors,
        versions={
            "python": platform.python_version(),
            "torch": torch.__version__,
            "numpy": np.__version__,
        },
        command=_command_line(),
    )


def _best_losses(history: History) -> dict[str, float]:
    return {
        "best_epoch": history.best + 1,
        "train_loss": history.train[history.best],
        "validation_loss": history.validation[history.best],
    }


def _errors(test: Transitions, sain: SainDynamics) -> dict[str, Any]:
    errors = evaluate(test, learned=sain) if sain.kind == LEARNED else evaluate(test, sain=sain)
    return {**errors, "open_loop": card_errors(test, sain)}


def _settings(command: TrainCommand) -> str:
    return json.dumps(asdict(command), indent=2, default=str) + "\n"


def _command_line() -> str:
    return shlex.join(["ros2", "run", "sain_model", "train", *sys.argv[1:]])


class EpochBar:
    """A bar over epochs with the losses and the time left."""

    def __init__(self, console: Console, epochs: int, done: int) -> None:
        self._bar = Progress(
            TextColumn("epoch"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[losses]}, left"),
            TimeRemainingColumn(),
            console=console,
        )
        self._task = self._bar.add_task("train", total=epochs, completed=done, losses="starting")

    def __enter__(self) -> Callable[[int, History], None]:
        self._bar.start()
        return self._advance

    def _advance(self, epoch: int, history: History) -> None:
        losses = (
            f"training {history.train[-1]:.3f}, validation {history.validation[-1]:.3f},"
            f" best {history.validation[history.best]:.3f}"
        )
        self._bar.update(self._task, completed=epoch, losses=losses)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


if __name__ == "__main__":
    sys.exit(main())
