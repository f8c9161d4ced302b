"""Losses for TensorBoard, where it is asked for: an optional extra."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from sain_core.errors import ConfigError
from sain_model.training.training_state import History

FOLDER: Final = "tensorboard"  # below the training's folder


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

    def __enter__(self) -> Callable[[int, History], None]:
        return self._add

    def _add(self, epoch: int, history: History) -> None:
        """Write the losses of the epoch that was done last, counted from 1."""
        self._writer.add_scalar("loss/training", history.train[-1], epoch)
        if math.isfinite(history.validation[-1]):
            self._writer.add_scalar("loss/validation", history.validation[-1], epoch)
        self._writer.flush()

    def __exit__(self, *_: object) -> None:
        self._writer.close()
