"""Training on single pushes: Algorithm 1, phase II of the paper, on the residual of a prior."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from sain_core.config import Config, option
from sain_core.dataset import SHARES, TEST, VALIDATION
from sain_core.dynamics import Dynamics
from sain_core.plugins import check_model_name
from sain_core.seeding import generator
from sain_model.compute.threads import settle_threads
from sain_model.data.batches import BOOTSTRAP, ORDER, Batches
from sain_model.data.dataset import Dataset, Split
from sain_model.data.examples import training_examples
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.load import PLANAR, PLANAR_PRIORS, load_prior
from sain_model.dynamics.loss import LossConfig, mixed_loss
from sain_model.dynamics.sain import SainDynamics
from sain_model.network.features import PUSH_FRAME
from sain_model.network.interaction_network import (
    InteractionNetwork,
    NetworkConfig,
    new_network,
)
from sain_model.physics.friction import FrictionFilter
from sain_model.training.training_loop import OptimizerConfig, Step, TrainingLoop

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
    mirror: bool = option(True, "train on mirror images too; not with features of the world")
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
    prior: str = option(PLANAR, "model that is corrected: a name in the registry of models")
    history: str = option(
        EPISODE,
        "pushes that the friction is inferred from in training: none, the episode's earlier ones,"
        " or all its others; only for planar priors",
        choices=(NOTHING, EARLIER, EPISODE),
    )
    prior_friction: float = option(
        0.12, "friction that the planar prior assumes", minimum=0.01, maximum=1.0
    )
    transitions: int = option(0, "learn from so many transitions only; 0: from all", minimum=0)
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()
    optimizer: OptimizerConfig = OptimizerConfig()

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
    check_model_name(config.prior)
    settings = {"friction": config.prior_friction} if config.prior in PLANAR_PRIORS else None
    prior = load_prior(config.prior, settings)
    return prior, None if config.history == NOTHING else make_filter(prior, train)


class Trainer(TrainingLoop):
    """Trains a network or an ensemble on single pushes."""

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
            friction: infers the friction that the prior is conditioned on; None: it is nominal.
            parent: whose weights it starts from, and keeps if no epoch is better; None: new ones.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.config = config
        self.epochs, self.patience = config.epochs, config.patience
        self.validate_every = config.validate_every
        self._prepare(split, prior, friction)
        about = f"{friction.config} {friction.nominal}" if friction else ""
        identity = f"{config} {split.train.sha256} {about}"
        settle_threads()
        self.network: InteractionNetwork = new_network(config.network, config.seed)
        start = None
        if parent is not None:
            identity += f" from {parent.model_hash}"
            self.network.load_state_dict(parent.network.state_dict())
            start = self._measure_validation()
        parameters = self.network.parameters()
        optimizer = config.optimizer.make(parameters, config.learning_rate, config.weight_decay)
        self._begin(folder / self.STATE, identity, optimizer, start)

    def _prepare(
        self, split: Split | MixedSplit, prior: Dynamics, friction: FrictionFilter | None
    ) -> None:
        config = self.config
        random = generator(config.seed, "history") if config.history == EARLIER else None
        usual = prior, friction
        self._train = training_examples(split.train, *usual, config.mirrors, random, config.network)
        self._validation = training_examples(
            split.validation, *usual, False, random, config.network
        )
        self._batches = Batches(
            config.seed,
            config.batch,
            np.tile(split.train.episode, len(self._train) // len(split.train)),  # and mirrored
            config.network.members,
            config.diversity,
            config.epoch_steps,
        )

    def _steps(self, epoch: int) -> Iterator[Step]:
        config, first = self.config, epoch * self._batches.steps
        for place, rows in enumerate(self._batches.epoch(epoch)):  # (M, b), own rows of each member
            share = config.optimizer.rate(epoch, config.epochs, first + place)
            yield Step(share * config.learning_rate, rows)

    def _losses(self, rows: Tensor) -> Tensor:
        examples = self._train
        predicted = self.network.each(examples.disks[rows], examples.relations[rows])
        return mixed_loss(predicted, examples, rows, self.config.loss)

    def _validate(self) -> float:
        """Return the loss of the members' mean."""
        data = self._validation
        predicted = self.network(data.disks, data.relations)
        return mixed_loss(predicted, data, torch.arange(len(data)), self.config.loss).item()
