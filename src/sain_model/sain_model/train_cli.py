"""``ros2 run sain_model train``: learn the residual of a prior from collected transitions."""

import json
import platform
import shlex
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
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
from sain_model.dataset import Split, Transitions, limit_training
from sain_model.error_table import error_table, history_table
from sain_model.evaluation import evaluate
from sain_model.friction import FrictionConfig, FrictionFilter
from sain_model.friction_noise import fit_noise
from sain_model.load import load_prior, prior_settings
from sain_model.loss_plot import save_loss_curve
from sain_model.mixed import MixedSplit, MixedTransitions, load_datasets, split_datasets
from sain_model.planar import PlanarPrior
from sain_model.sain import IDENTITY, LEARNED, SainDynamics
from sain_model.training import NOTHING, History, Trainer, TrainingConfig


@dataclass(frozen=True)
class TrainCommand:
    """What to learn from, and where to."""

    dataset: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Shards *.npz or folders of them, one or more, also with different numbers of disks."""
    out: Path
    """Folder for checkpoint, card, loss curve and settings. Run again to go on after a stop."""
    name: str = "sain"
    """Name of the checkpoint."""
    training: TrainingConfig = TrainingConfig()


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
    data = load_datasets(command.dataset)
    split = split_datasets(data, config.seed, config.validation, config.test)
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
    infers = friction.config if friction else None
    sain = SainDynamics(trainer.network, prior, config.prior, friction=infers)
    errors = _held_out_errors(split, sain)
    card = make_card(command, data, split, trainer.history, errors, sain)
    path = command.out / f"{command.name}.safetensors"
    save_checkpoint(path, trainer.network, card)
    for part in ("all", "target_moved"):
        console.print(error_table(errors, part))
    console.print(history_table(errors))
    console.print(f"{path}: epoch {trainer.history.best + 1} of {config.epochs}")
    return path


def make_filter(prior: Dynamics, train: Transitions | MixedTransitions) -> FrictionFilter | None:
    """Return what infers friction for a prior, its noise fitted where the truth is known.

    None for a prior that knows no friction. Noise is fitted to the part with the most pushes.
    """
    if not isinstance(prior, PlanarPrior):
        return None
    data = max(train.parts, key=len)
    known = np.isfinite(data.friction).all()
    config = fit_noise(prior, data) if known else FrictionConfig()
    return FrictionFilter(prior, prior.config.friction, config)


def make_card(
    command: TrainCommand,
    data: Transitions | MixedTransitions,
    split: Split | MixedSplit,
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
        data={
            "path": " ".join(map(str, command.dataset)),
            "sha256": data.sha256,
            "sources": list(data.sources),
            "transitions": {name: len(part) for name, part in parts.items()},
            "episodes": {name: len(np.unique(part.episodes)) for name, part in parts.items()},
        },
        training={
            **asdict(config),
            "best_epoch": history.best + 1,
            "train_loss": history.train[history.best],
            "validation_loss": history.validation[history.best],
        },
        errors=errors,
        versions={
            "python": platform.python_version(),
            "torch": torch.__version__,
            "numpy": np.__version__,
        },
        command=_command_line(),
    )


def _held_out_errors(split: Split | MixedSplit, sain: SainDynamics) -> dict[str, Any]:
    """Return the errors on what was held out, or else on what chose the epoch.

    Where numbers of disks differ: those with the fewest disks, and all under "by_disks".
    """
    held_out = split.test if len(split.test) else split.validation
    errors = {part.disks: _errors(part, sain) for part in held_out.parts}
    result = dict(errors[min(errors)])
    result["held_out"] = "test" if len(split.test) else "validation"
    if len(errors) > 1:
        result["by_disks"] = {str(disks): part for disks, part in errors.items()}
    return result


def _errors(test: Transitions, sain: SainDynamics) -> dict[str, Any]:
    if sain.kind == LEARNED:
        return evaluate(test, learned=sain)
    return evaluate(test, sain=sain)


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
