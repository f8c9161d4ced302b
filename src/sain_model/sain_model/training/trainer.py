"""One trainer for everything that a network learns: steps, validation, the best weights, resuming.

What is learned is a `LearningObjective`. After each epoch a file holds all that a training needs
to go on after a stop, to the same bytes.
"""

import io
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Int
from numpy import ndarray
from torch import Tensor

from sain_core.errors import CheckpointError
from sain_core.guarding.untrusted import read_regular
from sain_core.output import write_whole
from sain_core.randomness import generator
from sain_model.compute.threads import settle_threads
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import BOOTSTRAP
from sain_model.training.settings import TrainingConfig

Progress = Callable[[int, "LossHistory"], None]  # called with the epochs done, and their losses


class LearningObjective(ABC):
    """What a network is to learn."""

    identity: str  # of the data and of all else that the losses depend on
    episodes: Int[ndarray, "M"]  # which episode each of the M rows to learn from belongs to
    members: int = 1  # for how many networks rows are drawn; 1: the same rows for all
    # largest norm of a member's gradient; longer ones are scaled to it
    max_grad_norm: float = math.inf

    @abstractmethod
    def losses(self, network: InteractionNetwork, rows: Int[Tensor, "M b"]) -> Tensor:
        """Return the loss of the rows to learn from, one or one for each member (M,)."""

    @abstractmethod
    def validate(self, network: InteractionNetwork) -> float:
        """Return the loss on the validation part, of a network in evaluation mode."""


@dataclass
class LossHistory:
    """Losses after each epoch, and which epoch was best.

    An epoch that was not validated has the last loss that was, or infinity before the first.
    """

    train: list[float] = field(default_factory=list)  # of the training part
    validation: list[float] = field(default_factory=list)  # of the validation part
    # of the validation part before the first epoch, where the weights to start from may be kept;
    # None: they may not
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


class Batches:
    """In which order members see the data: a function of seed and epoch alone.

    Member 0 of a differently ordered ensemble sees what a lone network with that seed sees.
    """

    def __init__(self, config: TrainingConfig, episodes: Int[ndarray, "M"], members: int) -> None:
        self._seed, self._size = config.seed, config.batch
        self._pass_steps = -(-len(episodes) // config.batch)
        self.steps = config.epoch_steps or self._pass_steps
        self._rows = [
            _bootstrap(config.seed, member, episodes)
            if config.diversity == BOOTSTRAP
            else np.arange(len(episodes))
            for member in range(members)
        ]

    def epoch(self, number: int) -> Iterator[Int[Tensor, "M b"]]:
        """Yield the rows of each batch of an epoch, counted from 0."""
        done = -1
        for step in range(number * self.steps, (number + 1) * self.steps):
            lap, place = divmod(step, self._pass_steps)
            if lap != done:
                batches, done = self._pass(lap).split(self._size, dim=1), lap
            yield batches[place]

    def _pass(self, number: int) -> Int[Tensor, "M rows"]:
        orders = []
        for member, rows in enumerate(self._rows):
            path = ("epoch", number) if member == 0 else ("epoch", number, "member", member)
            orders.append(rows[generator(self._seed, *path).permutation(len(rows))])
        return torch.from_numpy(np.stack(orders))


def _bootstrap(seed: int, member: int, episodes: Int[ndarray, "M"]) -> Int[ndarray, "M"]:
    """Return as many rows as there are, of whole episodes drawn with replacement."""
    random = generator(seed, "bootstrap", "member", member)
    order = np.argsort(episodes, kind="stable")
    _, first, counts = np.unique(episodes[order], return_index=True, return_counts=True)
    rows: list[ndarray] = []
    drawn = 0
    while drawn < len(episodes):
        one = int(random.integers(len(first)))
        rows.append(order[first[one] : first[one] + counts[one]])
        drawn += counts[one]
    return np.concatenate(rows)[: len(episodes)]


class Trainer:
    """Trains a network in place; what it does depends on objective and settings alone."""

    def __init__(
        self,
        network: InteractionNetwork,
        objective: LearningObjective,
        config: TrainingConfig,
        path: Path,
        keeps_start: bool = False,
        overwrite: bool = False,
    ) -> None:
        """Resume from the file at `path` where there is one.

        With `keeps_start`, the weights stay as they are if no epoch is better. With `overwrite`, a
        file of other settings or data is replaced.
        Raises `CheckpointError`: the file is damaged or of other settings or data.
        """
        settle_threads()
        self.network, self._objective, self._config = network, objective, config
        self._path, self._identity = path, f"{config} {objective.identity}"
        self._batches = Batches(config, objective.episodes, objective.members)
        self._optimizer = config.make_optimizer(network.parameters())
        self.history = LossHistory(start=self._validate() if keeps_start else None)
        self._best = self._weights()
        if path.exists():
            try:
                self._resume()
            except CheckpointError:
                if not overwrite:
                    raise

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return len(self.history.train)

    @property
    def finished(self) -> bool:
        """Whether all epochs are done, or the last ones were no better."""
        waited = self.epoch - 1 - self.history.best if self.epoch else 0
        return self.epoch >= self._config.epochs or 0 < self._config.patience <= waited

    def run(self, progress: Progress = lambda epoch, history: None) -> None:
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
        self.network.eval()

    def _run_epoch(self, epoch: int) -> float:
        config, total, seen = self._config, 0.0, 0
        self.network.train()
        for place, rows in enumerate(self._batches.epoch(epoch)):
            step = epoch * self._batches.steps + place
            for group in self._optimizer.param_groups:
                group["lr"] = config.rate(epoch, step)
            losses = self._objective.losses(self.network, rows)
            self._optimizer.zero_grad()
            losses.sum().backward()  # so that each member learns as if it were alone
            clip_gradients(self.network, self._objective.max_grad_norm)
            self._optimizer.step()
            total += losses.mean().item() * rows.shape[-1]
            seen += rows.shape[-1]
        return total / max(seen, 1)

    def _validation_loss(self, epoch: int) -> float:
        """Return the validation loss, of now or of when it was last measured."""
        if (epoch + 1) % self._config.validate_every and epoch + 1 < self._config.epochs:
            return self.history.validation[-1] if epoch else math.inf
        return self._validate()

    def _validate(self) -> float:
        self.network.eval()
        with torch.inference_mode():
            return self._objective.validate(self.network)

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
                f"{self._path} is damaged: {error}; --overwrite starts anew"
            ) from error
        if identity != self._identity:
            raise CheckpointError(
                f"{self._path} belongs to other settings or data; choose another --out, or"
                " --overwrite"
            )
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._best = state["best"]
        self.history = LossHistory(state["train"], state["validation"], self.history.start)


def clip_gradients(network: InteractionNetwork, most: float) -> None:
    """Scale the gradient of each member whose norm is larger to this norm."""
    if most == math.inf:
        return
    members = network.config.members
    gradients = [p.grad for p in network.parameters() if p.grad is not None]
    squares = sum((g.reshape(members, -1) ** 2).sum(dim=1) for g in gradients)
    factors = (most / (torch.as_tensor(squares).sqrt() + 1e-6)).clamp(max=1.0)
    for gradient in gradients:
        gradient.reshape(members, -1).mul_(factors[:, None])
