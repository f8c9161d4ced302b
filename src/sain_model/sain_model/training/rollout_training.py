"""Training on rollouts of the network's own predictions, so that errors do not pile up."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from sain_core.dynamics import Dynamics
from sain_core.seeding import generator
from sain_model.compute.threads import one_numba_thread, settle_threads
from sain_model.data.dataset import Dataset, Split
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.rollouts import RolloutConfig, Told, roll, rollout_loss
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.friction import FrictionFilter
from sain_model.training.trainer import TrainingConfig
from sain_model.training.training_state import History, TrainingState


@dataclass(frozen=True, eq=False)
class Lessons:
    """Windows to learn from, and the friction that the prior is told for each push."""

    windows: Windows
    friction: Told | None

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.windows)

    def select(self, which: np.ndarray) -> "Lessons":
        """Return the lessons that indices pick."""
        told = None if self.friction is None else self.friction[which]
        return Lessons(self.windows.select(which), told)


def make_lessons(
    data: Dataset, steps: int, friction: FrictionFilter | None, mirror: bool
) -> Lessons:
    """Return windows of at most so many pushes from every push on.

    Args:
        data: M pushes.
        steps: the most pushes of a window.
        friction: tells the prior what all other pushes of an episode show; None: nothing.
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


class RolloutTrainer:
    """Goes on with a network that has learned from single pushes.

    What it does depends on data, settings, seed and the network it starts from alone.
    """

    STATE: Final = "rollouts.pt"

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
            friction: infers the friction that the prior is told; None: it is the nominal one.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.network = network
        self.config = config
        self._training, self._prior = training, prior
        self._train = make_lessons(split.train, config.steps_ahead, friction, training.mirrors)
        self._validation = make_lessons(split.validation, config.steps_ahead, friction, False)
        told = f"{friction.config} {friction.nominal}" if friction else ""
        identity = f"{config} {training} {split.train.sha256} {told}"
        settle_threads()
        self._optimizer = torch.optim.AdamW(
            network.parameters(), config.rollout_rate, weight_decay=training.weight_decay
        )
        self._state = TrainingState(folder / self.STATE, identity, network, self._optimizer)

    @property
    def history(self) -> History:
        """Losses after each epoch."""
        return self._state.history

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return self._state.epochs

    def run(self, progress: Callable[[int, History], None] = lambda epoch, history: None) -> None:
        """Train to the last epoch and take the weights of the best one."""
        while self.epoch < self.config.rollout_epochs:
            with one_numba_thread():
                train = self._run_epoch(self.epoch)
                validation = self._validate()
            self._state.add(train, validation)
            progress(self.epoch, self.history)
        self._state.take_best()
        self.network.eval()

    def _run_epoch(self, epoch: int) -> float:
        config = self.config
        rate = 0.5 * config.rollout_rate * (1 + math.cos(math.pi * epoch / config.rollout_epochs))
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        random = generator(self._training.seed, "rollouts", epoch)
        order = random.permutation(len(self._train))
        total = 0.0
        self.network.train()
        for first in range(0, len(order), config.rollout_batch):
            rows = order[first : first + config.rollout_batch]
            loss = self._loss(self._train.select(rows))
            self._optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), config.largest_gradient)
            self._optimizer.step()
            total += loss.item() * len(rows)
        return total / len(order)

    def _loss(self, lessons: Lessons) -> Tensor:
        poses = roll(self.network, lessons.windows, self._prior, self.config, lessons.friction)
        return rollout_loss(poses, lessons.windows, self._training.loss)

    def _validate(self) -> float:
        self.network.eval()
        with torch.inference_mode():
            return self._loss(self._validation).item()
