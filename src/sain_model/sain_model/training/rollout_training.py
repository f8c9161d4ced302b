"""Training on rollouts of the network's own predictions, so that errors do not pile up."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import torch
from torch import Tensor

from sain_core.errors import DatasetError
from sain_core.model import Model
from sain_core.seeding import generator
from sain_core.types import Scalars
from sain_model.compute.threads import one_numba_thread
from sain_model.data.dataset import Dataset, Split
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.data.shaped_physics import others_friction
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.loss import rollout_loss
from sain_model.dynamics.rollouts import roll
from sain_model.dynamics.settings import RolloutConfig
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.friction import FrictionFilter
from sain_model.training.settings import TrainingConfig, cosine
from sain_model.training.training_loop import LossHistory, Step, TrainingLoop


class RolloutTrainer(TrainingLoop):
    """Goes on with a network that has learned from single pushes."""

    STATE: Final = "rollouts.pt"
    network: InteractionNetwork

    def __init__(
        self,
        network: InteractionNetwork,
        split: Split | MixedSplit,
        prior: Model,
        config: RolloutConfig,
        training: TrainingConfig,
        folder: Path,
        friction: FrictionFilter | None = None,
    ) -> None:
        """Prepare the windows; go on from the folder's state when one is there.

        The network is trained in place. `training` is how it learned from single pushes: seed,
        decay and loss stay.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
            DatasetError: scenes with different bodies.
        """
        self.network = network
        self.config = config
        self.epochs, self.max_grad_norm = config.rollout_epochs, config.max_grad_norm
        train, validation = _alike(split.train), _alike(split.validation)
        self._bodies = train.bodies
        self._training, self._prior = training, prior.with_bodies(train.bodies)
        self._train = make_windows(train, config.steps_ahead)
        if training.mirrors and train.bodies.all_round:
            image = make_windows(train.mirrored(), config.steps_ahead)
            self._train = self._train.and_then(image)
        self._validation = make_windows(validation, config.steps_ahead)
        self._train_friction = others_friction(train, friction)
        self._validation_friction = others_friction(validation, friction)
        about = f"{friction.config} {friction.nominal}" if friction else ""
        identity = f"{config} {training} {split.train.sha256} {about}"
        optimizer = torch.optim.AdamW(
            network.parameters(), config.rollout_learning_rate, weight_decay=training.weight_decay
        )
        self._begin(folder / self.STATE, identity, optimizer)

    def run(
        self, progress: Callable[[int, LossHistory], None] = lambda epoch, history: None
    ) -> None:
        """Train to the last epoch and take the weights of the best one."""
        with one_numba_thread():
            super().run(progress)
        self.network.eval()

    def _steps(self, epoch: int) -> Iterator[Step]:
        config = self.config
        rate = cosine(epoch, config.rollout_epochs) * config.rollout_learning_rate
        order = generator(self._training.seed, "rollouts", epoch).permutation(len(self._train))
        for rows in torch.from_numpy(order).split(config.rollout_batch):
            yield Step(rate, rows)

    def _losses(self, rows: Tensor) -> Tensor:
        return self._loss(self._train.select(rows.numpy()), self._train_friction)

    def _validate(self) -> float:
        return self._loss(self._validation, self._validation_friction).item()

    def _loss(self, windows: Windows, friction: Scalars | None) -> Tensor:
        # Behind a window's end nothing is pushed: any friction will do.
        told = None if friction is None else friction[windows.rows]
        poses = roll(self.network, windows, self._prior, told, self._bodies)
        return rollout_loss(poses, windows, self._training.loss)


def _alike(data: Dataset | MixedDataset) -> Dataset:
    """Return data whose scenes have the same bodies."""
    if len(data.parts) > 1:
        raise DatasetError("--steps-ahead needs scenes with the same bodies; give one folder")
    return data.parts[0]
