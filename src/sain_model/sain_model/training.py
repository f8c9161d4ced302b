"""Training: Algorithm 1, phase II of the paper, on the residual of a fast prior."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from sain_core.config import Config, option
from sain_core.dynamics import Dynamics
from sain_core.errors import CheckpointError
from sain_core.seeding import generator
from sain_model.checkpoint import write_torch
from sain_model.dataset import Split
from sain_model.examples import Examples, training_examples
from sain_model.features import PUSH_FRAME
from sain_model.friction import FrictionFilter
from sain_model.mixed import MixedSplit
from sain_model.network import InteractionNetwork, NetworkConfig
from sain_model.threads import settle_threads

NOTHING: Final = "none"
EARLIER: Final = "earlier"
EPISODE: Final = "episode"


@dataclass(frozen=True)
class LossConfig(Config):
    """The mixed loss of Algorithm 1, line 17, each term in units of a scale."""

    robust: bool = option(True, "Huber's loss: beyond a scale an error counts linearly")
    position_scale: float = option(0.001, "of position errors", unit="m", minimum=1e-6)
    velocity_scale: float = option(0.1, "of velocity errors", unit="m/s", minimum=1e-6)
    heading_scale: float = option(0.05, "of errors of sin and cos of the heading", minimum=1e-6)


@dataclass(frozen=True)
class TrainingConfig(Config):
    """How a network is trained."""

    seed: int = option(0, "same seed, data and settings: same weights", minimum=0)
    epochs: int = option(40, "passes over the data", minimum=1)
    batch: int = option(128, "pushes in a step of the optimiser", minimum=1)
    learning_rate: float = option(2e-3, "at the start; falls to 0 along a cosine", minimum=1e-7)
    weight_decay: float = option(0.1, "of AdamW, the paper's lambda", minimum=0.0)
    mirror: bool = option(
        True, "learn every push in a mirror too, except in the frame of the world"
    )
    validation: float = option(
        0.1, "share of the episodes that choose the best epoch", minimum=0.01, maximum=0.5
    )
    test: float = option(
        0.15,
        "share of the episodes held out; 0: none, training and validation share all",
        minimum=0.0,
        maximum=0.5,
    )
    prior: str = option(
        "planar", "what is corrected", choices=("planar", "planar_axes", "identity")
    )
    history: str = option(
        EPISODE,
        "what shows the prior the friction in training: nothing, the episode's earlier pushes, or"
        " all its others; the identity prior has no friction to be told",
        choices=(NOTHING, EARLIER, EPISODE),
    )
    prior_friction: float = option(
        0.12, "friction that the planar prior assumes", minimum=0.01, maximum=1.0
    )
    transitions: int = option(0, "learn from so many transitions only; 0: from all", minimum=0)
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()


@dataclass
class History:
    """Losses after each epoch, and which epoch was best."""

    train: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)

    @property
    def best(self) -> int:
        """The epoch (from 0) with the lowest validation loss."""
        return int(np.argmin(self.validation))


def mixed_loss(
    predicted: Float[Tensor, "B N 3"], examples: Examples, rows: Tensor, config: LossConfig
) -> Tensor:
    """Return Algorithm 1's loss of a batch: position, velocity, sine and cosine of the heading.

    It is a function of what is left of the residual alone: distances do not depend on the frame,
    and |sin a - sin b|^2 + |cos a - cos b|^2 = 2 - 2 cos(a - b).
    """
    missing = examples.residual[rows] - predicted
    squares = [
        (missing[..., :2] / config.position_scale).square().sum(-1),
        (examples.velocity[rows] / config.velocity_scale).square().sum(-1),
        (2.0 - 2.0 * torch.cos(missing[..., 2])) / config.heading_scale**2,
    ]
    if config.robust:
        squares = [2.0 * (torch.sqrt(1.0 + square) - 1.0) for square in squares]
    total: Tensor = squares[0] + squares[1] + squares[2]
    return total.mean()


class Trainer:
    """Trains one network; what it does depends on data, settings and seed alone."""

    STATE: Final = "training.pt"

    def __init__(
        self,
        split: Split | MixedSplit,
        prior: Dynamics,
        config: TrainingConfig,
        folder: Path,
        friction: FrictionFilter | None = None,
    ) -> None:
        """Prepare the data; go on from the folder's state when one is there.

        Args:
            split: what to learn from, and what to choose the best epoch by.
            prior: what is corrected.
            config: how.
            folder: of the state.
            friction: infers the friction that the prior is told; None: it is the nominal one.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.config = config
        self.history = History()
        self._folder = folder
        random = generator(config.seed, "history") if config.history == EARLIER else None
        frame = config.network.features
        mirror = config.mirror and frame == PUSH_FRAME  # a tilted table in a mirror is another one
        self._train = training_examples(split.train, prior, friction, mirror, random, frame)
        self._validation = training_examples(
            split.validation, prior, friction, False, random, frame
        )
        about = f"{friction.config} {friction.nominal}" if friction else ""
        self._identity = f"{config} {split.train.sha256} {about}"
        settle_threads()
        torch.manual_seed(int(generator(config.seed, "weights").integers(2**31)))
        self.network = InteractionNetwork(config.network)
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(), config.learning_rate, weight_decay=config.weight_decay
        )
        self._best: dict[str, Tensor] = _copy(self.network)
        if (folder / self.STATE).exists():
            self._resume()

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return len(self.history.train)

    def run(self, progress: Callable[[int, History], None] = lambda epoch, history: None) -> None:
        """Train to the last epoch and take the weights of the best one."""
        while self.epoch < self.config.epochs:
            self.history.train.append(self._run_epoch(self.epoch))
            self.history.validation.append(self._validate())
            if self.history.best == self.epoch - 1:
                self._best = _copy(self.network)
            self._save()
            progress(self.epoch, self.history)
        self.network.load_state_dict(self._best)

    def _run_epoch(self, epoch: int) -> float:
        config = self.config
        rate = 0.5 * config.learning_rate * (1.0 + math.cos(math.pi * epoch / config.epochs))
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        order = torch.from_numpy(
            generator(config.seed, "epoch", epoch).permutation(len(self._train))
        )
        total = 0.0
        self.network.train()
        for rows in order.split(config.batch):
            predicted = self.network(self._train.disks[rows], self._train.relations[rows])
            loss = mixed_loss(predicted, self._train, rows, config.loss)
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()
            total += loss.item() * len(rows)
        return total / len(self._train)

    def _validate(self) -> float:
        data = self._validation
        self.network.eval()
        with torch.inference_mode():
            predicted = self.network(data.disks, data.relations)
            return mixed_loss(predicted, data, torch.arange(len(data)), self.config.loss).item()

    def _save(self) -> None:
        state = {
            "identity": self._identity,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "best": self._best,
            "train": self.history.train,
            "validation": self.history.validation,
        }
        write_torch(self._folder / self.STATE, state)

    def _resume(self) -> None:
        path = self._folder / self.STATE
        try:
            state: dict[str, Any] = torch.load(path, weights_only=True)
            identity = state["identity"]
        except Exception as error:
            raise CheckpointError(f"{path} is damaged: {error}; remove it to start anew") from error
        if identity != self._identity:
            raise CheckpointError(
                f"{path} belongs to other settings or data; choose another folder or remove it"
            )
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._best = state["best"]
        self.history = History(state["train"], state["validation"])


def _copy(network: InteractionNetwork) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in network.state_dict().items()}
