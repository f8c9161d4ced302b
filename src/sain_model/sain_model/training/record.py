"""What is shown of a training while it runs, and what is written beside its checkpoint."""

import json
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from sain_core.errors import ConfigError
from sain_core.output import write_whole
from sain_core.provenance import DISTRIBUTION, processor, ros2_command, system, versions
from sain_core.view.figures import TEXT, new_figure, style_axes
from sain_core.view.palette import PALETTE
from sain_model.data.dataset import Dataset, Split
from sain_model.dynamics.load import SUFFIX, ModelCard
from sain_model.dynamics.priors import prior_settings
from sain_model.dynamics.sain import RECURRENT, RESIDUAL, SainDynamics
from sain_model.evaluation.errors import Figures
from sain_model.evaluation.predictors import HISTORY, PRIOR, PRIOR_HISTORY
from sain_model.inference.kinds import FRICTION, written_kind
from sain_model.training.fit import STATES
from sain_model.training.settings import TrainOptions
from sain_model.training.trainer import LossHistory, Progress

FOLDER: Final = "tensorboard"  # below the training's folder
SETTINGS: Final = "config.json"
PICTURES: Final = ("loss.png", "rollout_loss.png")


@contextmanager
def epoch_bar(console: Console, epochs: int, done: int) -> Iterator[Progress]:
    """Show a bar over epochs with the losses and the time left."""
    losses, left = TextColumn("{task.fields[losses]}, left"), TimeRemainingColumn()
    columns = TextColumn("epoch"), BarColumn(), MofNCompleteColumn(), losses, left
    with Bars(*columns, console=console) as bar:
        task = bar.add_task("train", total=epochs, completed=done, losses="starting")

        def advance(epoch: int, history: LossHistory) -> None:
            losses = (
                f"training {history.train[-1]:.4g}, validation {history.validation[-1]:.4g},"
                f" best {history.best_loss:.4g}"
            )
            bar.update(task, completed=epoch, losses=losses)

        yield advance


@contextmanager
def event_log(folder: Path, done: int) -> Iterator[Progress]:
    """Write the losses of each epoch below a folder; those after `done` epochs are replaced.

    Raises `ConfigError`: tensorboardX is not installed.
    """
    try:
        from tensorboardX import SummaryWriter
    except ImportError:
        raise ConfigError(
            "--tensorboard needs tensorboardX, which is not installed; install it with"
            " pip install '.[tensorboard]' in the checkout, or leave --tensorboard out"
        ) from None
    writer: Any
    with SummaryWriter(str(folder / FOLDER), purge_step=done + 1) as writer:

        def add(epoch: int, history: LossHistory) -> None:
            writer.add_scalar("loss/training", history.train[-1], epoch)
            if math.isfinite(history.validation[-1]):
                writer.add_scalar("loss/validation", history.validation[-1], epoch)
            writer.flush()

        yield add


RESIDUALS: Final = (RESIDUAL, RECURRENT)  # without physics a network predicts all by itself
PACKAGES: Final = (DISTRIBUTION, "torch", "numpy", "numba", "scipy", "safetensors")


def make_card(
    command: TrainOptions,
    data: Dataset,
    split: Split,
    model: SainDynamics,
    histories: Sequence[LossHistory],
    errors: dict[str, Any],
    parent: ModelCard | None = None,
) -> ModelCard:
    """Return the card of what was trained: with losses on single pushes, then on rollouts."""
    config = command.training
    training = {**asdict(config), **_losses(histories[0])}
    if len(histories) > 1:
        training["rollouts"] = _losses(histories[1])
    kind, intervals = model.belief.trained, model.network and model.network.intervals
    return ModelCard(
        prior=config.prior,
        prior_config=prior_settings(kind.prior),
        network=asdict(config.network),
        bottoms=_bottoms(split.train, parent) if model.origin.kind in RESIDUALS else [],
        friction={"width": kind.stated[FRICTION][1]} if FRICTION in kind.names else None,
        bodies=written_kind(kind) if kind.of_bodies else None,
        intervals=asdict(intervals) if intervals else None,
        kind=model.origin.kind,
        data=_data_part(command.dataset, data, split),
        training=training,
        errors=errors,
        versions=environment(),
        command=ros2_command("sain_model", "train"),
        parent={**asdict(parent), "errors": {}} if parent else None,
    )


def own_errors(errors: Figures, name: str) -> Figures:
    """Return what a card has of errors: after one push, of the model and of its prior."""
    kept = (name, name + HISTORY, PRIOR, PRIOR_HISTORY)
    once = {
        part: {
            group: {one: figures for one, figures in by_name.items() if one in kept}
            for group, by_name in errors["after"]["1"][part].items()
        }
        for part in ("errors", "ratios")
    }
    return {**errors, "after": {"1": once}}


def _bottoms(learned: Dataset, parent: ModelCard | None) -> list[str]:
    """Return what bodies stood on; a parent that states nothing corrects all."""
    if parent and not parent.bottoms:
        return []
    found = {shape.bottom for part in learned.parts for shape in part.bodies.shapes}
    return sorted(found.union(parent.bottoms if parent else ()))


def _data_part(paths: Sequence[Path], data: Dataset, split: Split) -> dict[str, Any]:
    """Return what a card says of the data."""
    parts = {"train": split.train, "validation": split.validation, "test": split.test}
    return {
        "path": " ".join(map(str, paths)),
        "sha256": data.sha256,
        "sources": list(data.sources),
        "transitions": {name: len(part) for name, part in parts.items()},
        "worlds": {name: part.counts for name, part in parts.items()},
        "episodes": {name: len(np.unique(part.episode)) for name, part in parts.items()},
    }


def _losses(history: LossHistory) -> dict[str, float | None]:
    best = history.best
    losses = {
        "epochs_done": len(history.train),
        "best_epoch": best + 1,  # 0: the weights that it started from
        "train_loss": history.train[best] if best >= 0 else None,
        "validation_loss": history.best_loss,
    }
    return losses if history.start is None else {**losses, "loss_before": history.start}


def environment() -> dict[str, str]:
    """Return versions and machine, as far as they can change a bit of a checkpoint."""
    return {**versions(*PACKAGES), "system": system(), "processor": processor()}


def save_settings(command: TrainOptions, data: Dataset) -> None:
    """Write beside the checkpoint, from the start, what is to be done with what."""
    settings = {
        **asdict(command),
        "data_sha256": data.sha256,
        "environment": environment(),
        "command": ros2_command("sain_model", "train"),
    }
    text = json.dumps(settings, indent=2, default=str) + "\n"
    write_whole(command.out / SETTINGS, text.encode())


def written_names(name: str) -> list[str]:
    """Return the files that a training of this name writes.

    Raises `ConfigError`: the name is a path, hidden, a pattern, or that of another file.
    """
    if not re.fullmatch(r"\w[\w.+-]*", name) or f"{name}.json" == SETTINGS:
        raise ConfigError(
            f"--name is {name!r}; allowed: letters, digits, '_', '-', '+' and '.', no '.' at first,"
            f" and not {Path(SETTINGS).stem!r}: it is a file's name in --out"
        )
    return [f"{name}{SUFFIX}", f"{name}.json", SETTINGS, *PICTURES, *STATES]


def draw_losses(history: LossHistory) -> Figure:
    """Draw the losses after each epoch, the weights that are kept marked."""
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    style_axes(axes, grid="both", xlabel="epoch", ylabel="loss, mean over transitions")
    epochs = range(1, len(history.train) + 1)
    axes.plot(epochs, history.train, label="training", color=PALETTE.physics)
    axes.plot(epochs, history.validation, label="validation", color=PALETTE.predicted)
    kept = f"kept: epoch {history.best + 1}, {history.best_loss:.4g}"
    axes.plot(history.best + 1, history.best_loss, "o", color=PALETTE.predicted, label=kept)
    if history.start is not None:
        before = "validation before the training"
        axes.axhline(history.start, color=PALETTE.floor, linestyle=":", label=before)
    figure.legend(frameon=False, loc="outside lower center", ncols=2, fontsize=TEXT)
    return figure
