"""What shows a training while it runs: a bar in the terminal, and TensorBoard as an extra."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_core.errors import ConfigError
from sain_model.training.training_state import LossHistory

FOLDER: Final = "tensorboard"  # below the training's folder


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

    def __enter__(self) -> Callable[[int, LossHistory], None]:
        self._bar.start()
        return self._advance

    def _advance(self, epoch: int, history: LossHistory) -> None:
        losses = (
            f"training {history.train[-1]:.3f}, validation {history.validation[-1]:.3f},"
            f" best {history.best_loss:.3f}"
        )
        self._bar.update(self._task, completed=epoch, losses=losses)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


class EventLog:
    """Writes the losses after each epoch; a training that goes on replaces what came later."""

    def __init__(self, folder: Path, done: int) -> None:
        """Write below this folder, from the epoch on that comes after `done` ones.

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
        self._writer: Any = SummaryWriter(str(folder / FOLDER), purge_step=done + 1)

    def __enter__(self) -> Callable[[int, LossHistory], None]:
        return self._add

    def _add(self, epoch: int, history: LossHistory) -> None:
        """Write the losses of the epoch that was done last, counted from 1."""
        self._writer.add_scalar("loss/training", history.train[-1], epoch)
        if math.isfinite(history.validation[-1]):
            self._writer.add_scalar("loss/validation", history.validation[-1], epoch)
        self._writer.flush()

    def __exit__(self, *_: object) -> None:
        self._writer.close()
