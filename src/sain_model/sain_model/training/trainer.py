"""Training: Algorithm 1, phase II of the paper, on the residual of a fast prior."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch

from sain_core.config import Config, option
from sain_core.dataset import SHARES, TEST, VALIDATION
from sain_core.dynamics import Dynamics
from sain_core.seeding import generator
from sain_model.compute.threads import settle_threads
from sain_model.data.batches import BOOTSTRAP, ORDER, Batches
from sain_model.data.dataset import Dataset, Split
from sain_model.data.examples import training_examples
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.load import PLANAR, PRIORS, load_prior
from sain_model.dynamics.loss import LossConfig, mixed_loss
from sain_model.dynamics.sain import IDENTITY, SainDynamics
from sain_model.network.features import PUSH_FRAME
from sain_model.network.interaction_network import NetworkConfig, new_network
from sain_model.physics.friction import FrictionFilter
from sain_model.training.optimizer import DescentConfig
from sain_model.training.training_state import History, TrainingState

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
        SHARES[VALIDATION],
        "share of the episodes that choose the best epoch",
        minimum=0.01,
        maximum=0.5,
    )
    test: float = option(
        SHARES[TEST],
        "share of the episodes held out; 0: none, training and validation share all",
        minimum=0.0,
        maximum=0.5,
    )
    prior: str = option(PLANAR, "what is corrected", choices=PRIORS)
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

    @property
    def mirrors(self) -> bool:
        """Whether mirror images are learned from: a tilted table in a mirror is another table."""
        return self.mirror and self.network.features == PUSH_FRAME


def prior_and_filter(
    config: TrainingConfig, train: Dataset | MixedDataset
) -> tuple[Dynamics, FrictionFilter | None]:
    """Return what is corrected, and what infers the friction that it is told; None: nothing does.

    Args:
        config: of the training.
        train: what the filter's noise is fitted to.
    """
    settings = {"friction": config.prior_friction} if config.prior != IDENTITY else None
    prior = load_prior(config.prior, settings)
    return prior, None if config.history == NOTHING else make_filter(prior, train)


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
        parent: SainDynamics | None = None,
    ) -> None:
        """Prepare the data; go on from the folder's state when one is there.

        Args:
            split: what to learn from, and what to choose the best epoch by.
            prior: what is corrected.
            config: how.
            folder: of the state.
            friction: infers the friction that the prior is told; None: it is the nominal one.
            parent: whose weights it starts from, and keeps if no epoch is better; None: new ones.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.config = config
        random = generator(config.seed, "history") if config.history == EARLIER else None
        network = config.network
        self._train = training_examples(
            split.train, prior, friction, config.mirrors, random, network
        )
        self._validation = training_examples(
            split.validation, prior, friction, False, random, network
        )
        about = f"{friction.config} {friction.nominal}" if friction else ""
        identity = f"{config} {split.train.sha256} {about}"
        settle_threads()
        self.network = new_network(config.network, config.seed)
        if parent is not None:
            identity += f" from {parent.model_hash}"
            self.network.load_state_dict(parent.network.state_dict())
        self._optimizer = config.descent.make(
            self.network.parameters(), config.learning_rate, config.weight_decay
        )
        self._batches = Batches(
            config.seed,
            config.batch,
            np.tile(split.train.episode, len(self._train) // len(split.train)),  # and mirrored
            config.network.members,
            config.diversity,
            config.epoch_steps,
        )
        start = None if parent is None else self._measure_validation()
        self._state = TrainingState(
            folder / self.STATE, identity, self.network, self._optimizer, start
        )

    @property
    def history(self) -> History:
        """Losses after each epoch."""
        return self._state.history

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return self._state.epochs

    @property
    def finished(self) -> bool:
        """Whether all epochs are done, or the last ones brought nothing."""
        waited = self.epoch - 1 - self.history.best if self.epoch else 0
        patience = self.config.patience
        return self.epoch >= self.config.epochs or 0 < patience <= waited

    def run(self, progress: Callable[[int, History], None] = lambda epoch, history: None) -> None:
        """Train to the last epoch and take the weights of the best one."""
        while not self.finished:
            train = self._run_epoch(self.epoch)
            self._state.add(train, self._validation_loss(self.epoch))
            progress(self.epoch, self.history)
        self._state.take_best()

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
        return self._measure_validation()

    def _measure_validation(self) -> float:
        data = self._validation
        self.network.eval()
        with torch.inference_mode():
            predicted = self.network(data.disks, data.relations)
            return mixed_loss(predicted, data, torch.arange(len(data)), self.config.loss).item()
