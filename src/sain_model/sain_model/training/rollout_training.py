"""Training on rollouts of the network's own predictions, so that errors do not pile up."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from sain_core.dynamics import Dynamics
from sain_core.seeding import generator
from sain_model.compute.threads import one_numba_thread
from sain_model.data.dataset import Dataset, Split
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.rollouts import PushFrictions, roll, rollout_loss
from sain_model.dynamics.settings import RolloutConfig
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.friction import FrictionFilter
from sain_model.training.settings import TrainingConfig, cosine
from sain_model.training.training_loop import Step, TrainingLoop
from sain_model.training.training_state import LossHistory


@dataclass(frozen=True, eq=False)
class Lessons:
    """Windows to learn from, and the friction that the prior is conditioned on for each push."""

    windows: Windows
    friction: PushFrictions | None

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.windows)

    def select(self, which: np.ndarray) -> "Lessons":
        """Return the lessons that indices pick."""
        friction = None if self.friction is None else self.friction[which]
        return Lessons(self.windows.select(which), friction)


def make_lessons(
    data: Dataset, steps: int, friction: FrictionFilter | None, mirror: bool
) -> Lessons:
    """Return windows of at most so many pushes from every push on.

    Args:
        data: M pushes.
        steps: the most pushes of a window.
        friction: infers the friction from all other pushes of an episode; None: it is nominal.
        mirror: whether to add the mirror images.
    """
    told = None
    if friction is not None:
        likelihood = friction.log_likelihood(data.state, data.action, data.next_state)
        told = friction.others(likelihood, data.episode).mean
    windows = make_windows(data, steps)
    if mirror:
        windows = windows.and_then(make_windows(data.mirrored(), steps))
    # Behind a window's end nothing is pushed: any friction will do.
    return Lessons(windows, None if told is None else told[windows.rows])


class RolloutTrainer(TrainingLoop):
    """Goes on with a network that has learned from single pushes."""

    STATE: Final = "rollouts.pt"
    network: InteractionNetwork

    def __init__(
        self,
        network: InteractionNetwork,
        split: Split,
        prior: Dynamics,
        config: RolloutConfig,
        training: TrainingConfig,
        folder: Path,
        friction: FrictionFilter | None = None,
    ) -> None:
        """Prepare the windows; go on from the folder's state when one is there.

        Args:
            network: to start from; trained in place.
            split: what to learn from, and to choose the best epoch by.
            prior: what is corrected.
            config: how to roll out.
            training: how it learned from single pushes: seed, decay and loss stay.
            folder: of the state.
            friction: infers the friction that the prior is conditioned on; None: it is nominal.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.network = network
        self.config = config
        self.epochs, self.max_grad_norm = config.rollout_epochs, config.max_grad_norm
        self._training, self._prior = training, prior
        self._train = make_lessons(split.train, config.steps_ahead, friction, training.mirrors)
        self._validation = make_lessons(split.validation, config.steps_ahead, friction, False)
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
        return self._loss(self._train.select(rows.numpy()))

    def _validate(self) -> float:
        return self._loss(self._validation).item()

    def _loss(self, lessons: Lessons) -> Tensor:
        poses = roll(self.network, lessons.windows, self._prior, self.config, lessons.friction)
        return rollout_loss(poses, lessons.windows, self._training.loss)
