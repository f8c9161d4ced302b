"""One training loop for every loss: steps of the optimizer, validation, the best weights, resuming.

What is learned is a subclass: it gives the steps of an epoch and the loss of a step.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor, nn

from sain_model.compute.threads import settle_threads
from sain_model.training.training_state import LossHistory, TrainingState


class Step(NamedTuple):
    """One step of the optimizer."""

    learning_rate: float
    rows: Tensor  # (b,) of the examples, or (M, b): each member's own


class TrainingLoop(ABC):
    """Trains a network; what it does depends on data, settings and seed alone.

    Attributes:
        network: in training.
        epochs: in all.
        patience: epochs without a better validation loss after which it ends; 0: it does not.
        validate_every: epochs from one validation to the next.
        max_grad_norm: norm to which longer gradients are cut; None: they are not.
    """

    network: nn.Module
    epochs: int
    patience: int = 0
    validate_every: int = 1
    max_grad_norm: float | None = None

    def _begin(
        self,
        path: Path,
        identity: str,
        optimizer: torch.optim.Optimizer,
        start: float | None = None,
    ) -> None:
        """Go on from the state at a path where there is one; see `TrainingState`."""
        settle_threads()
        self._optimizer = optimizer
        self._state = TrainingState(path, identity, self.network, optimizer, start)

    @abstractmethod
    def _steps(self, epoch: int) -> Iterable[Step]:
        """Yield the steps of an epoch."""

    @abstractmethod
    def _losses(self, rows: Tensor) -> Tensor:
        """Return the loss of the examples in these rows, one or one for each member (M,)."""

    @abstractmethod
    def _validate(self) -> float:
        """Return the loss on the validation part, of a network in evaluation mode."""

    @property
    def history(self) -> LossHistory:
        """Losses after each epoch."""
        return self._state.history

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return self._state.epochs

    @property
    def finished(self) -> bool:
        """Whether all epochs are done, or the last ones were no better."""
        waited = self.epoch - 1 - self.history.best if self.epoch else 0
        return self.epoch >= self.epochs or 0 < self.patience <= waited

    def run(
        self, progress: Callable[[int, LossHistory], None] = lambda epoch, history: None
    ) -> None:
        """Train to the last epoch and take the weights of the best one."""
        while not self.finished:
            train = self._run_epoch(self.epoch)
            self._state.add(train, self._validation_loss(self.epoch))
            progress(self.epoch, self.history)
        self._state.take_best()

    def _run_epoch(self, epoch: int) -> float:
        total, seen = 0.0, 0
        self.network.train()
        for learning_rate, rows in self._steps(epoch):
            for group in self._optimizer.param_groups:
                group["lr"] = learning_rate
            losses = self._losses(rows)
            self._optimizer.zero_grad()
            losses.sum().backward()  # so that each member learns as if it were alone
            if self.max_grad_norm is not None:
                nn.utils.clip_grad_norm_(self.network.parameters(), self.max_grad_norm)
            self._optimizer.step()
            total += losses.mean().item() * rows.shape[-1]
            seen += rows.shape[-1]
        return total / max(seen, 1)

    def _validation_loss(self, epoch: int) -> float:
        """Return the validation loss, of now or of when it was last measured."""
        if (epoch + 1) % self.validate_every and epoch + 1 < self.epochs:
            return self.history.validation[-1] if epoch else math.inf
        return self._measure_validation()

    def _measure_validation(self) -> float:
        self.network.eval()
        with torch.inference_mode():
            return self._validate()
