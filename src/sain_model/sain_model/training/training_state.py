"""What a training keeps after each epoch, so that it goes on after a stop to the same bytes."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from sain_core.errors import CheckpointError
from sain_model.dynamics.checkpoint import write_torch


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


class TrainingState:
    """A network in training with its optimiser, its losses and its best weights, in one file.

    Attributes:
        history: the losses so far.
    """

    def __init__(
        self,
        path: Path,
        identity: str,
        network: nn.Module,
        optimizer: torch.optim.Optimizer,
        start: float | None = None,
    ) -> None:
        """Go on from the file when it is there.

        Args:
            path: of the file.
            identity: of settings and data; a state of another is refused.
            network: gets the weights of the file.
            optimizer: likewise its state.
            start: validation loss of the network as it is, if it may be the best; None: it may not.

        Raises:
            CheckpointError: the file is damaged or of other settings or data.
        """
        self.history = LossHistory(start=start)
        self._path, self._identity = path, identity
        self._network, self._optimizer = network, optimizer
        self._best = self._weights()
        if path.exists():
            self._resume()

    @property
    def epochs(self) -> int:
        """How many epochs are done."""
        return len(self.history.train)

    def add(self, train: float, validation: float) -> None:
        """Keep the losses of an epoch, the weights if they are the best, and write the file."""
        self.history.train.append(train)
        self.history.validation.append(validation)
        if self.history.best == self.epochs - 1:
            self._best = self._weights()
        self._save()

    def take_best(self) -> None:
        """Give the network its best weights."""
        self._network.load_state_dict(self._best)

    def _weights(self) -> dict[str, Tensor]:
        return {name: value.clone() for name, value in self._network.state_dict().items()}

    def _save(self) -> None:
        state = {
            "identity": self._identity,
            "network": self._network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "best": self._best,
            "train": self.history.train,
            "validation": self.history.validation,
        }
        write_torch(self._path, state)

    def _resume(self) -> None:
        try:
            state: dict[str, Any] = torch.load(self._path, weights_only=True)
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
        self._network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._best = state["best"]
        self.history = LossHistory(state["train"], state["validation"], self.history.start)
