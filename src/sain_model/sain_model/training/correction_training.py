"""Training of a network inside the planar prior: gradients come from simulated variations."""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from sain_core.config import Config, option
from sain_core.seeding import generator
from sain_model.compute.threads import settle_threads
from sain_model.data.dataset import Dataset, Split
from sain_model.data.examples import Examples, make_examples
from sain_model.dynamics.correction_network import (
    InsideNetwork,
    InsideNetworkConfig,
    InsideNetworks,
)
from sain_model.dynamics.loss import LossConfig, mixed_loss
from sain_model.dynamics.physics_gradient import moves, told_moves
from sain_model.network.features import WORLD_FRAME
from sain_model.network.interaction_network import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.training_state import History, TrainingState


@dataclass(frozen=True)
class InsideTrainingConfig(Config):
    """How a network inside physics is trained."""

    seed: int = option(0, "same seed, data and settings: same weights", minimum=0)
    steps: int = option(3000, "steps of the optimiser", minimum=1)
    batch: int = option(64, "pushes in a step", minimum=1)
    learning_rate: float = option(2e-3, "at the start; falls to 0 along a cosine", minimum=1e-7)
    weight_decay: float = option(0.01, "of AdamW", minimum=0.0)
    steepest: float = option(50.0, "longest gradient of a step; more is cut off", minimum=1e-3)
    rounds: int = option(20, "how often validation looks for the best weights", minimum=1)
    network: InsideNetworkConfig = InsideNetworkConfig()
    loss: LossConfig = LossConfig()


@dataclass(frozen=True)
class _Lesson:
    """Pushes, what the network sees of them, and how they go when the prior is told nothing."""

    data: Dataset
    examples: Examples
    plain: Tensor  # (M, N, 3)

    @classmethod
    def make(cls, data: Dataset, prior: PlanarPrior) -> "_Lesson":
        after = prior.step(data.state, data.action)
        plain = moves(data.state, data.action, after).astype(np.float32)
        examples = make_examples(data, prior, None, NetworkConfig(features=WORLD_FRAME))
        return cls(data, examples, torch.from_numpy(plain))


class InsideTrainer:
    """Trains one network; what it does depends on data, settings and seed alone."""

    STATE: Final = "training.pt"

    def __init__(
        self, split: Split, prior: PlanarPrior, config: InsideTrainingConfig, folder: Path
    ) -> None:
        """Prepare the data; go on from the folder's state when one is there.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.config = config
        self._prior = prior
        self._train = _Lesson.make(split.train, prior)
        self._validation = _Lesson.make(split.validation, prior)
        identity = f"{config} {prior.config} {split.train.sha256} {len(split.train)}"
        settle_threads()
        torch.manual_seed(int(generator(config.seed, "weights").integers(2**31)))
        self.network = InsideNetwork(config.network)
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(), config.learning_rate, weight_decay=config.weight_decay
        )
        self._state = TrainingState(folder / self.STATE, identity, self.network, self._optimizer)

    @property
    def history(self) -> History:
        """Losses after each round."""
        return self._state.history

    @property
    def round(self) -> int:
        """How many rounds are done."""
        return self._state.epochs

    def run(self, progress: Callable[[int, History], None] = lambda number, history: None) -> None:
        """Train to the last round and take the weights of the best one."""
        while self.round < self.config.rounds:
            train = self._run_round(self.round)
            self._state.add(train, self._validate())
            progress(self.round, self.history)
        self._state.take_best()

    def _run_round(self, number: int) -> float:
        config, total = self.config, 0.0
        ends = np.linspace(0, config.steps, config.rounds + 1).round().astype(int)
        self.network.train()
        for step in range(ends[number], ends[number + 1]):
            rate = 0.5 * config.learning_rate * (1.0 + math.cos(math.pi * step / config.steps))
            for group in self._optimizer.param_groups:
                group["lr"] = rate
            loss = self._loss(self._train, self._rows(step))
            self._optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), config.steepest)
            self._optimizer.step()
            total += loss.item()
        return float(total / max(ends[number + 1] - ends[number], 1))

    def _rows(self, step: int) -> Tensor:
        """Return the pushes of a step: the data in one random order after the other."""
        batches = max(len(self._train.data) // self.config.batch, 1)
        epoch, place = divmod(step, batches)
        order = generator(self.config.seed, "epoch", epoch).permutation(len(self._train.data))
        first = place * self.config.batch
        return torch.from_numpy(order[first : first + self.config.batch])

    def _loss(self, lesson: _Lesson, rows: Tensor) -> Tensor:
        examples, picked = lesson.examples, rows.numpy()
        corrections, residual = self.network(examples.disks[rows], examples.relations[rows])
        data = lesson.data
        told = told_moves(corrections, self._prior, data.state[picked], data.action[picked])
        predicted = told - lesson.plain[rows] + residual
        return mixed_loss(predicted, examples, rows, self.config.loss)

    def _validate(self) -> float:
        self.network.eval()
        with torch.inference_mode():
            return self._loss(self._validation, torch.arange(len(self._validation.data))).item()


def make_trainers(
    split: Split, prior: PlanarPrior, config: InsideTrainingConfig, folder: Path
) -> list[InsideTrainer]:
    """Return a trainer for each member; each goes on from its state when one is there.

    Args:
        split: what to learn from, and what to choose the best rounds by.
        prior: what they are put inside.
        config: its seed is the first member's, the others' follow.
        folder: of the states, one a member.

    Raises:
        CheckpointError: a state in the folder is damaged or of other settings or data.
    """
    seeds = range(config.seed, config.seed + config.network.members)
    return [
        InsideTrainer(split, prior, replace(config, seed=seed), folder / f"member-{member}")
        for member, seed in enumerate(seeds)
    ]


def train_members(
    trainers: Sequence[InsideTrainer],
    progress: Callable[[int, int, History], None] = lambda member, number, history: None,
) -> tuple[InsideNetworks, list[History]]:
    """Train all members, one after the other; return them and their histories.

    Args:
        trainers: of the members.
        progress: is told member, rounds done and history.
    """
    networks = InsideNetworks(trainers[0].config.network)
    for member, trainer in enumerate(trainers):
        trainer.run(functools.partial(progress, member))
        networks[member] = trainer.network
    return networks, [trainer.history for trainer in trainers]
