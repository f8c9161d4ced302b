"""What shows a training while it runs: a bar in the terminal, and TensorBoard as an extra."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from sain_core.errors import ConfigError
from sain_model.training.trainer import LossHistory, Progress

FOLDER: Final = "tensorboard"  # below the training's folder


@contextmanager
def epoch_bar(console: Console, epochs: int, done: int) -> Iterator[Progress]:
    """Show a bar over epochs with the losses and the time left."""
    losses, left = TextColumn("{task.fields[losses]}, left"), TimeRemainingColumn()
    columns = TextColumn("epoch"), BarColumn(), MofNCompleteColumn(), losses, left
    with Bars(*columns, console=console) as bar:
        task = bar.add_task("train", total=epochs, completed=done, losses="starting")

        def advance(epoch: int, history: LossHistory) -> None:
            losses = (
                f"training {history.train[-1]:.3f}, validation {history.validation[-1]:.3f},"
                f" best {history.best_loss:.3f}"
            )
            bar.update(task, completed=epoch, losses=losses)

        yield advance


@contextmanager
def event_log(folder: Path, done: int) -> Iterator[Progress]:
    """Write the losses of each epoch below a folder; those after `done` epochs are replaced.

    Raises:
        ConfigError: tensorboardX is not installed.
    """
    try:
        from tensorboardX import SummaryWriter
    except ImportError:
        raise ConfigError(
            "--tensorboard needs tensorboardX, which is not installed; install it with"
            " pip install 'sain_model[tensorboard]', or leave --tensorboard out"
        ) from None
    writer: Any
    with SummaryWriter(str(folder / FOLDER), purge_step=done + 1) as writer:

        def add(epoch: int, history: LossHistory) -> None:
            writer.add_scalar("loss/training", history.train[-1], epoch)
            if math.isfinite(history.validation[-1]):
                writer.add_scalar("loss/validation", history.validation[-1], epoch)
            writer.flush()

        yield add
