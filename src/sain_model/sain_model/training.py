"""Training: Algorithm 1, phase II of the paper, on the residual of a fast prior."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from sain_core.config import Config, option
from sain_core.dynamics import Dynamics
from sain_core.errors import CheckpointError
from sain_core.seeding import generator
from sain_model.batches import BOOTSTRAP, ORDER, Batches
from sain_model.checkpoint import write_torch
from sain_model.dataset import Split
from sain_model.descent import DescentConfig
from sain_model.examples import training_examples
from sain_model.features import PUSH_FRAME
from sain_model.friction import FrictionFilter
from sain_model.loss import LossConfig, mixed_loss
from sain_model.mixed import MixedSplit
from sain_model.network import InteractionNetwork, NetworkConfig, new_network
from sain_model.threads import settle_threads

NOTHING: Final = "none"
EARLIER: Final = "earlier"
EPISODE: Final = "episode"


@dataclass(frozen=True)
class TrainingConfig(Config):
    """How a network is trained."""

    seed: int = option(0, "same seed, data and settings: same weights", minimum=0)
    epochs: int = option(40, "passes over the data", minimum=1)
    epoch_steps: int = option(0, "steps in an epoch; 0: as many as one pass takes", minimum=0)
    validate_every: int = option(1, "epochs from one look at validation to the next", minimum=1)
    patience: int = option(
        0, "stop after so many epochs without a better validation loss; 0: never", minimum=0
    )
    batch: int = option(128, "pushes in a step of the optimiser", minimum=1)
    learning_rate: float = option(2e-3, "at the start", minimum=1e-7)
    weight_decay: float = option(0.1, "of the optimiser, the paper's lambda", minimum=0.0)
    diversity: str = option(
        ORDER,
        "each member of an ensemble learns from all pushes in an order of its own, or from"
        " episodes drawn with replacement",
        choices=(ORDER, BOOTSTRAP),
    )
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
    descent: DescentConfig = DescentConfig()


@dataclass
class History:
    """Losses after each epoch, and which epoch was best.

    An epoch that was not validated has the last loss that was, or infinity before the first.
    """

    train: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)

    @property
    def best(self) -> int:
        """The epoch (from 0) with the lowest validation loss."""
        return int(np.argmin(self.validation))


class Trainer:
    """Trains a network or an ensemble; what it does depends on data, settings and seed alone."""

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
        network = config.network
        # A tilted table in a mirror is another one.
        mirror = config.mirror and network.features == PUSH_FRAME
        self._train = training_examples(split.train, prior, friction, mirror, random, network)
        self._validation = training_examples(
            split.validation, prior, friction, False, random, network
        )
        about = f"{friction.config} {friction.nominal}" if friction else ""
        self._identity = f"{config} {split.train.sha256} {about}"
        settle_threads()
        self.network = new_network(config.network, config.seed)
        self._optimizer = config.descent.make(
            self.network.parameters(), config.learning_rate, config.weight_decay
        )
        self._batches = Batches(
            config.seed,
            config.batch,
            np.tile(split.train.episodes, len(self._train) // len(split.train)),  # and mirrored
            config.network.members,
            config.diversity,
            config.epoch_steps,
        )
        self._best: dict[str, Tensor] = _copy(self.network)
        if (folder / self.STATE).exists():
            self._resume()

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return len(self.history.train)

    @property
    def finished(self) -> bool:
        """Whether all epochs are done, or the last ones brought nothing."""
        waited = self.epoch - 1 - self.history.best if self.epoch else 0
        patience = self.config.patience
        return self.epoch >= self.config.epochs or 0 < patience <= waited

    def run(self, progress: Callable[[int, History], None] = lambda epoch, history: None) -> None:
        """Train to the last epoch and take the weights of the best one."""
        while not self.finished:
            epoch = self.epoch
            self.history.train.append(self._run_epoch(epoch))
            self.history.validation.append(self._validation_loss(epoch))
            if self.history.best == epoch:
                self._best = _copy(self.network)
            self._save()
            progress(self.epoch, self.history)
        self.network.load_state_dict(self._best)

    def _run_epoch(self, epoch: int) -> float:
        config, examples = self.config, self._train
        total, seen = 0.0, 0
        self.network.train()
        for place, rows in enumerate(self._batches.epoch(epoch)):  # (M, b), own rows of each member
            self._set_rate(epoch, epoch * self._batches.steps + place)
            predicted = self.network.each(examples.disks[rows], examples.relations[rows])
            losses = mixed_loss(predicted, examples, rows, config.loss)  # (M,)
            self._optimizer.zero_grad()
            losses.sum().backward()  # so that each member learns as if it were alone
            self._optimizer.step()
            total += losses.mean().item() * rows.shape[1]
            seen += rows.shape[1]
        return total / seen

    def _set_rate(self, epoch: int, step: int) -> None:
        share = self.config.descent.rate(epoch, self.config.epochs, step)
        for group in self._optimizer.param_groups:
            group["lr"] = share * self.config.learning_rate

    def _validation_loss(self, epoch: int) -> float:
        """Return the loss of the members' mean, of now or of when it was last looked at."""
        if (epoch + 1) % self.config.validate_every and epoch + 1 < self.config.epochs:
            return self.history.validation[-1] if epoch else math.inf
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
