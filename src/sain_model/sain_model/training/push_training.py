"""Training on single pushes: Algorithm 1, phase II of the paper, on the residual of a prior."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from sain_core.model import Model, check_model_name
from sain_core.seeding import generator
from sain_model.compute.threads import settle_threads
from sain_model.data.batches import Batches
from sain_model.data.dataset import Dataset, Split
from sain_model.data.examples import training_examples
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.loss import mixed_loss
from sain_model.dynamics.priors import load_prior
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import PLANAR_PRIORS
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.physics.friction import FrictionFilter
from sain_model.training.settings import EARLIER, NOTHING, TrainingConfig
from sain_model.training.training_loop import Step, TrainingLoop


def prior_and_filter(
    config: TrainingConfig, train: Dataset | MixedDataset
) -> tuple[Model, FrictionFilter | None]:
    """Return what is corrected, and what infers the friction that it is told; None: nothing does.

    The filter's noise is fitted to the training part.
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
        prior: Model,
        config: TrainingConfig,
        folder: Path,
        friction: FrictionFilter | None = None,
        parent: SainDynamics | None = None,
    ) -> None:
        """Prepare the data; go on from the folder's state when one is there.

        Args:
            split: what to learn from, and what to choose the best epoch by.
            prior: what is corrected.
            config: settings.
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
        self, split: Split | MixedSplit, prior: Model, friction: FrictionFilter | None
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
        predicted = self.network.each(examples.bodies[rows], examples.relations[rows])
        return mixed_loss(predicted, examples, rows, self.config.loss)

    def _validate(self) -> float:
        """Return the loss of the members' mean."""
        data = self._validation
        predicted = self.network(data.bodies, data.relations)
        return mixed_loss(predicted, data, torch.arange(len(data)), self.config.loss).item()
