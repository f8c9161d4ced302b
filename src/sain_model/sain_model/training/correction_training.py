"""Training of parameter corrections: gradients come from simulated variations."""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from sain_core.seeding import generator
from sain_model.compute.threads import settle_threads
from sain_model.data.dataset import Dataset, Split
from sain_model.data.examples import Examples, make_examples
from sain_model.dynamics.correction_network import CorrectionEnsemble, CorrectionNetwork
from sain_model.dynamics.loss import mixed_loss
from sain_model.dynamics.physics_gradient import conditioned_moves, moves
from sain_model.network.settings import WORLD_FRAME, NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.settings import CorrectionTrainingConfig, cosine
from sain_model.training.training_loop import LossHistory, Step, TrainingLoop


@dataclass(frozen=True)
class _Lesson:
    """Pushes, what the network sees of them, and the moves that the uncorrected prior predicts."""

    data: Dataset
    examples: Examples
    plain: Tensor  # (M, N, 3)

    @classmethod
    def make(cls, data: Dataset, prior: PlanarPrior) -> "_Lesson":
        after = prior.step(data.state, data.action)
        plain = moves(data.state, data.action, after).astype(np.float32)
        examples = make_examples(data, prior, None, NetworkConfig(features=WORLD_FRAME))
        return cls(data, examples, torch.from_numpy(plain))


class CorrectionTrainer(TrainingLoop):
    """Trains one network that corrects the parameters of a prior."""

    STATE: Final = "training.pt"
    network: CorrectionNetwork

    def __init__(
        self, split: Split, prior: PlanarPrior, config: CorrectionTrainingConfig, folder: Path
    ) -> None:
        """Prepare the data; go on from the folder's state when one is there.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.config = config
        self.epochs, self.max_grad_norm = config.epochs, config.max_grad_norm
        self._prior = prior
        self._train = _Lesson.make(split.train, prior)
        self._validation = _Lesson.make(split.validation, prior)
        identity = f"{config} {prior.config} {split.train.sha256} {len(split.train)}"
        settle_threads()
        torch.manual_seed(int(generator(config.seed, "weights").integers(2**31)))
        self.network = CorrectionNetwork(config.network)
        optimizer = torch.optim.AdamW(
            self.network.parameters(), config.learning_rate, weight_decay=config.weight_decay
        )
        self._begin(folder / self.STATE, identity, optimizer)

    def _steps(self, epoch: int) -> Iterator[Step]:
        config = self.config
        ends = np.linspace(0, config.steps, config.epochs + 1).round().astype(int)
        for step in range(ends[epoch], ends[epoch + 1]):
            rate = cosine(step, config.steps) * config.learning_rate
            yield Step(rate, self._rows(step))

    def _rows(self, step: int) -> Tensor:
        """Return the pushes of a step: the data in one random order after the other."""
        batches = max(len(self._train.data) // self.config.batch, 1)
        epoch, place = divmod(step, batches)
        order = generator(self.config.seed, "epoch", epoch).permutation(len(self._train.data))
        first = place * self.config.batch
        return torch.from_numpy(order[first : first + self.config.batch])

    def _losses(self, rows: Tensor) -> Tensor:
        return self._loss(self._train, rows)

    def _loss(self, lesson: _Lesson, rows: Tensor) -> Tensor:
        examples, picked = lesson.examples, rows.numpy()
        corrections, residual = self.network(examples.disks[rows], examples.relations[rows])
        data = lesson.data
        told = conditioned_moves(corrections, self._prior, data.state[picked], data.action[picked])
        predicted = told - lesson.plain[rows] + residual
        return mixed_loss(predicted, examples, rows, self.config.loss)

    def _validate(self) -> float:
        return self._loss(self._validation, torch.arange(len(self._validation.data))).item()


def make_trainers(
    split: Split, prior: PlanarPrior, config: CorrectionTrainingConfig, folder: Path
) -> list[CorrectionTrainer]:
    """Return a trainer for each member; each goes on from its state when one is there.

    The seed is the first member's, the others' follow.

    Raises:
        CheckpointError: a state in the folder is damaged or of other settings or data.
    """
    seeds = range(config.seed, config.seed + config.network.members)
    return [
        CorrectionTrainer(split, prior, replace(config, seed=seed), folder / f"member-{member}")
        for member, seed in enumerate(seeds)
    ]


def train_members(
    trainers: Sequence[CorrectionTrainer],
    progress: Callable[[int, int, LossHistory], None] = lambda member, number, history: None,
) -> tuple[CorrectionEnsemble, list[LossHistory]]:
    """Train all members, one after the other; return them and their histories.

    `progress` is called with member, epochs done and history.
    """
    networks = CorrectionEnsemble(trainers[0].config.network)
    for member, trainer in enumerate(trainers):
        trainer.run(functools.partial(progress, member))
        networks[member] = trainer.network
    return networks, [trainer.history for trainer in trainers]
