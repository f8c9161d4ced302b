"""Training of parameter corrections: gradients come from simulated variations."""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from sain_core.seeding import generator
from sain_model.compute.threads import settle_threads
from sain_model.data.dataset import Dataset, Split
from sain_model.data.examples import Examples, make_examples
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.data.shaped_physics import others_friction
from sain_model.dynamics.correction_network import CorrectionEnsemble, CorrectionNetwork
from sain_model.dynamics.loss import mixed_loss
from sain_model.dynamics.physics_gradient import ToldPushes, conditioned_moves, moves
from sain_model.network.features import push_frames
from sain_model.network.settings import NetworkConfig
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.parameters import known_friction
from sain_model.physics.planar import PlanarPrior
from sain_model.training.settings import CorrectionTrainingConfig, cosine
from sain_model.training.training_loop import LossHistory, Step, TrainingLoop


@dataclass(frozen=True)
class _Lesson:
    """Pushes, what the network sees of them, and the moves that the uncorrected prior predicts."""

    parts: tuple[ToldPushes, ...]  # one for all of the same bodies
    examples: Examples  # of all parts, one after the other
    plain: Tensor  # (M, N, 3)

    @classmethod
    def make(
        cls,
        data: Dataset | MixedDataset,
        prior: PlanarPrior,
        friction: FrictionFilter | None,
        seen: NetworkConfig,
    ) -> "_Lesson":
        most = max(part.disks for part in data.parts)
        parts, examples, plain = [], [], []
        for part in data.parts:
            told = _told(part, prior, friction)
            parts.append(told)
            examples.append(make_examples(part, prior, told.friction, seen).padded(most))
            after = told.prior.step(part.state, part.action, known_friction(told.friction))
            way = torch.from_numpy(moves(part.state, told.frames, after).astype(np.float32))
            plain.append(_padded(way, most))
        return cls(tuple(parts), examples[0].and_then(*examples[1:]), torch.cat(plain))

    def __len__(self) -> int:
        return len(self.examples)

    def moves(self, corrections: Tensor, rows: Tensor) -> Tensor:
        """Return the moves (b, N, 3) of the pushes in these rows when told corrections."""
        ends = np.cumsum([len(part.pushes) for part in self.parts])
        owner = np.searchsorted(ends, rows.numpy(), side="right")
        found, places = [], []
        for number in np.unique(owner):
            part, here = self.parts[number], np.flatnonzero(owner == number)
            some = part.select(rows.numpy()[here] - (ends[number] - len(part.pushes)))
            told = corrections[torch.from_numpy(here), : part.scenes.shape[1]]
            found.append(_padded(conditioned_moves(told, some), corrections.shape[1]))
            places.append(here)
        return torch.cat(found)[torch.from_numpy(np.argsort(np.concatenate(places)))]


def _told(data: Dataset, prior: PlanarPrior, friction: FrictionFilter | None) -> ToldPushes:
    """Return pushes on the prior of their bodies, with the friction that other pushes tell of."""
    shaped = prior.with_bodies(data.bodies)
    assert isinstance(shaped, PlanarPrior)
    frames = push_frames(data.state, data.action, data.bodies)
    return ToldPushes(shaped, data.state, data.action, frames, others_friction(data, friction))


def _padded(motion: Tensor, bodies: int) -> Tensor:
    """Return moves (M, N, 3) of so many bodies, of which those that are missing do not move."""
    return functional.pad(motion, (0, 0, 0, bodies - motion.shape[1]))


class CorrectionTrainer(TrainingLoop):
    """Trains one network that corrects the parameters of a prior."""

    STATE: Final = "training.pt"
    network: CorrectionNetwork

    def __init__(
        self,
        split: Split | MixedSplit,
        prior: PlanarPrior,
        config: CorrectionTrainingConfig,
        folder: Path,
        friction: FrictionFilter | None = None,
    ) -> None:
        """Prepare the data; go on from the folder's state when one is there.

        `friction` infers the friction that the prior is told; None: it is nominal.

        Raises:
            CheckpointError: the state in the folder is damaged or of other settings or data.
        """
        self.config = config
        self.epochs, self.max_grad_norm = config.epochs, config.max_grad_norm
        seen = config.network.seen
        self._train = _Lesson.make(split.train, prior, friction, seen)
        self._validation = _Lesson.make(split.validation, prior, friction, seen)
        identity = f"{config} {prior.config} {split.train.sha256} {len(split.train)}"
        identity += f" {friction.config}" if friction else ""
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
        batches = max(len(self._train) // self.config.batch, 1)
        epoch, place = divmod(step, batches)
        order = generator(self.config.seed, "epoch", epoch).permutation(len(self._train))
        first = place * self.config.batch
        return torch.from_numpy(order[first : first + self.config.batch])

    def _losses(self, rows: Tensor) -> Tensor:
        return self._loss(self._train, rows)

    def _loss(self, lesson: _Lesson, rows: Tensor) -> Tensor:
        examples = lesson.examples
        corrections, residual = self.network(examples.bodies[rows], examples.relations[rows])
        predicted = lesson.moves(corrections, rows) - lesson.plain[rows] + residual
        return mixed_loss(predicted, examples, rows, self.config.loss)

    def _validate(self) -> float:
        return self._loss(self._validation, torch.arange(len(self._validation))).item()


def make_trainers(
    split: Split | MixedSplit,
    prior: PlanarPrior,
    config: CorrectionTrainingConfig,
    folder: Path,
    friction: FrictionFilter | None = None,
) -> list[CorrectionTrainer]:
    """Return a trainer for each member; each goes on from its state when one is there.

    The seed is the first member's, the others' follow. `friction` infers the friction that the
    prior is told; None: it is nominal.

    Raises:
        CheckpointError: a state in the folder is damaged or of other settings or data.
    """
    seeds = range(config.seed, config.seed + config.network.members)
    return [
        CorrectionTrainer(
            split, prior, replace(config, seed=seed), folder / f"member-{member}", friction
        )
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
