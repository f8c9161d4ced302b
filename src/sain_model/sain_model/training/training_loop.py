"""One training loop for every loss: steps of the optimizer, validation, the best weights, resuming.

What is learned is a subclass: it gives the steps of an epoch and the loss of a step. After each
epoch a file holds all that a training needs to go on after a stop, to the same bytes.
"""

import io
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from sain_core.errors import CheckpointError
from sain_core.storage import write_whole
from sain_core.untrusted import read_regular
from sain_model.compute.threads import settle_threads


@dataclass
class LossHistory:
    """Losses after each epoch, and which epoch was best.

    An epoch that was not validated has the last loss that was, or infinity before the first.

    Attributes:
        train: of the training part.
        validation: of the validation part.
        start: of the validation part before the first epoch, where the weights to start from may
            be kept; None: they may not.
    """

    train: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)
    start: float | None = None

    @property
    def best(self) -> int:
        """The epoch (from 0) with the lowest validation loss; -1: none is below the start's."""
        lowest = int(np.argmin(self.validation)) if self.validation else -1
        if self.start is None or (lowest >= 0 and self.validation[lowest] < self.start):
            return lowest
        return -1

    @property
    def best_loss(self) -> float:
        """The validation loss of the weights that are kept; infinity while there are none."""
        if self.best >= 0:
            return self.validation[self.best]
        return math.inf if self.start is None else self.start


class Step(NamedTuple):
    """One step of the optimizer."""

    learning_rate: float
    rows: Tensor  # (b,) of the examples, or (M, b): each member's own


class TrainingLoop(ABC):
    """Trains a network; what it does depends on data, settings and seed alone."""

    network: nn.Module
    epochs: int  # in all
    patience: int = 0  # epochs without a better validation loss after which it ends; 0: never
    validate_every: int = 1  # epochs from one validation to the next
    max_grad_norm: float | None = None  # to which longer gradients are cut; None: they are not
    history: LossHistory  # so far

    def _begin(
        self,
        path: Path,
        identity: str,
        optimizer: torch.optim.Optimizer,
        start: float | None = None,
    ) -> None:
        """Go on from the file at a path where there is one.

        Args:
            path: of the state.
            identity: of settings and data; a state of another is refused.
            optimizer: of the network.
            start: validation loss of the network as it is, if it may be the best; None: it may not.

        Raises:
            CheckpointError: the file is damaged or of other settings or data.
        """
        settle_threads()
        self._path, self._identity, self._optimizer = path, identity, optimizer
        self.history = LossHistory(start=start)
        self._best = self._weights()
        if path.exists():
            self._resume()

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
    def epoch(self) -> int:
        """How many epochs are done."""
        return len(self.history.train)

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
            train, validation = self._run_epoch(self.epoch), self._validation_loss(self.epoch)
            self.history.train.append(train)
            self.history.validation.append(validation)
            if self.history.best == self.epoch - 1:
                self._best = self._weights()
            self._save()
            progress(self.epoch, self.history)
        self.network.load_state_dict(self._best)

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

    def _weights(self) -> dict[str, Tensor]:
        return {name: value.clone() for name, value in self.network.state_dict().items()}

    def _save(self) -> None:
        state = {
            "identity": self._identity,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "best": self._best,
            "train": self.history.train,
            "validation": self.history.validation,
        }
        buffer = io.BytesIO()
        torch.save(state, buffer)
        write_whole(self._path, buffer.getvalue())

    def _resume(self) -> None:
        try:
            content = io.BytesIO(read_regular(self._path))
            state: dict[str, Any] = torch.load(content, weights_only=True)
            identity = state["identity"]
        except Exception as error:
            raise CheckpointError(
                f"{self._path} is damaged: {error}; remove it to start anew"
            ) from error
        if identity != self._identity:
            raise CheckpointError(
                f"{self._path} belongs to other settings or data; choose another folder or"
                " remove it"
            )
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._best = state["best"]
        self.history = LossHistory(state["train"], state["validation"], self.history.start)
