"""What a terminal shows of a training."""

from collections.abc import Callable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_model.training.training_state import History


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
            f" best {history.best_loss:.3f}"
        )
        self._bar.update(self._task, completed=epoch, losses=losses)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
