"""Training on rollouts of the network's own predictions, so that errors do not pile up."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from sain_core.dynamics import Dynamics
from sain_core.errors import CheckpointError
from sain_core.seeding import generator
from sain_model.checkpoint import write_torch
from sain_model.dataset import Split, Transitions
from sain_model.features import PUSH_FRAME
from sain_model.friction import FrictionFilter
from sain_model.network import InteractionNetwork
from sain_model.rollouts import RolloutConfig, Told, roll, rollout_loss
from sain_model.threads import one_numba_thread, settle_threads
from sain_model.training import History, TrainingConfig
from sain_model.windows import Windows, make_windows


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
    data: Transitions, steps: int, friction: FrictionFilter | None, mirror: bool
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
        likelihood = friction.log_likelihood(data.scenes, data.pushes, data.next_scenes)
        told = friction.others(likelihood, data.episodes).mean
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
        self.config, self.history = config, History()
        self._training, self._prior, self._folder = training, prior, folder
        mirror = training.mirror and network.config.features == PUSH_FRAME
        self._train = make_lessons(split.train, config.steps_ahead, friction, mirror)
        self._validation = make_lessons(split.validation, config.steps_ahead, friction, False)
        told = f"{friction.config} {friction.nominal}" if friction else ""
        self._identity = f"{config} {training} {split.train.sha256} {told}"
        settle_threads()
        self._optimizer = torch.optim.AdamW(
            network.parameters(), config.rollout_rate, weight_decay=training.weight_decay
        )
        self._best = _copy(network)
        if (folder / self.STATE).exists():
            self._resume()

    @property
    def epoch(self) -> int:
        """How many epochs are done."""
        return len(self.history.train)

    def run(self, progress: Callable[[int, History], None] = lambda epoch, history: None) -> None:
        """Train to the last epoch and take the weights of the best one."""
        while self.epoch < self.config.rollout_epochs:
            with one_numba_thread():
                self.history.train.append(self._run_epoch(self.epoch))
                self.history.validation.append(self._validate())
            if self.history.best == self.epoch - 1:
                self._best = _copy(self.network)
            self._save()
            progress(self.epoch, self.history)
        self.network.load_state_dict(self._best)
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
