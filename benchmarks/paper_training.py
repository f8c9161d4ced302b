"""How long training takes to the best validation loss that the paper's settings reach.

./env ros2 run sain_sim collect --episodes 1560 --workers 2 --seed 1 --floor-episodes 190 \
    --out data/randomised
./env python -m benchmarks.paper_training data/randomised --out runs/paper
./env python -m benchmarks.paper_training data/rough --features world --ours-batch 64 \
    --ours-epochs 85 --transitions 2800 --epochs 300 --out runs/paper-rough

Two trainings on the same 3,000 transitions, split and prior: the paper's settings to the letter
(`train --preset paper`), and ours (`train`). Both are judged by one loss, the paper's: squared,
on the same validation episodes, after every epoch. The paper looks only every 500 epochs; it is
given the best of *all* epochs here. After 500 of its 8,000 epochs it is stopped: its learning rate
has by then been halved 37 times, and its loss does not change in any bit from epoch to epoch. Run
it again to go on after a stop.
"""

import json
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import torch
import tyro
from rich.console import Console

from benchmarks.report import Figure, report
from sain_core.storage import write_whole
from sain_model.data.dataset import Split, limit_training, load_dataset, split_by_episode
from sain_model.data.examples import Examples, make_examples
from sain_model.dynamics.priors import make_prior
from sain_model.inference.kinds import Kind, friction_kind
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import PUSH_FRAME, NetworkConfig
from sain_model.training.objectives import SinglePushes, mixed_loss
from sain_model.training.settings import NOTHING, PAPER, TrainingConfig
from sain_model.training.trainer import LossHistory, Trainer

TARGET = 180.0  # [s]


@dataclass(frozen=True)
class Command:
    """What to train on."""

    dataset: Annotated[Path, tyro.conf.Positional] = Path("data/randomised")
    """A collection."""
    out: Path = Path("runs/paper")
    """Folder of the states and of the report."""
    transitions: int = 3000
    """To learn from, as many as the paper has."""
    epochs: int = 500
    """Of the paper's training, of 8,000."""
    features: str = PUSH_FRAME
    """What both networks see: "push", or "world" for a rough world."""
    ours_epochs: int = TrainingConfig().epochs
    """Of our training."""
    ours_batch: int = TrainingConfig().batch
    """Of our training."""
    seed: int = 0
    """Of the split and of training."""


class Course:
    """The paper's loss after each epoch of a training, and the processor time until then [s]."""

    def __init__(self, path: Path, trainer: Trainer, examples: Examples, epochs: int) -> None:
        """Go on with what the file holds; stop after so many epochs."""
        self._path = path
        self._trainer = trainer
        self._examples = examples
        self._epochs = epochs
        course = json.loads(path.read_text()) if path.exists() else {"losses": [], "seconds": []}
        self.losses: list[float] = course["losses"][: trainer.epoch]
        self.seconds: list[float] = course["seconds"][: trainer.epoch]

    def run(self) -> None:
        """Train and measure; what is measured does not count."""
        self._begun = time.process_time()
        while self._trainer.epoch < self._epochs and not self._trainer.finished:
            try:
                self._trainer.run(self._measure)
            except StopIteration:
                break

    def _measure(self, epoch: int, history: LossHistory) -> None:
        earlier = self.seconds[-1] if self.seconds else 0.0
        self.seconds.append(earlier + time.process_time() - self._begun)
        data = self._examples
        with torch.inference_mode():
            predicted = self._trainer.network(data.bodies, data.relations)
            loss = mixed_loss(predicted, data, torch.arange(len(data)), PAPER.loss)
        self.losses.append(loss.item())
        course = {"losses": self.losses, "seconds": self.seconds}
        write_whole(self._path, (json.dumps(course) + "\n").encode())
        self._begun = time.process_time()
        if epoch >= self._epochs:
            raise StopIteration

    def first(self, loss: float) -> int | None:
        """Return the first epoch (from 0) with at most this loss."""
        return next((epoch for epoch, value in enumerate(self.losses) if value <= loss), None)


def main() -> None:
    """Train both ways and report the times."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=main.__doc__)
    split = split_by_episode(
        load_dataset(command.dataset), command.seed, PAPER.validation, PAPER.test
    )
    split = limit_training(split, command.transitions)
    kind = friction_kind(make_prior(PAPER.prior), infers=False)
    network = NetworkConfig(features=command.features)
    ours = TrainingConfig(
        epochs=command.ours_epochs,
        batch=command.ours_batch,
        validation=PAPER.validation,
        history=NOTHING,
        network=network,
    )
    paper = replace(PAPER, validate_every=1, network=network)  # looking changes no weight
    courses = {
        "paper": follow(command, "paper", paper, split, kind, command.epochs),
        "ours": follow(command, "ours", ours, split, kind, ours.epochs),
    }
    examples = make_examples(split.validation.alike, kind.prior, None, network)
    nothing = mixed_loss(
        torch.zeros_like(examples.residual), examples, torch.arange(len(examples)), PAPER.loss
    )
    show(command, courses, split, nothing.item())


def follow(
    command: Command, name: str, config: TrainingConfig, split: Split, kind: Kind, epochs: int
) -> Course:
    """Train with these settings to so many epochs and return what came of it."""
    folder = command.out / name
    seeded = replace(config, seed=command.seed)
    network = new_network(seeded.network, seeded.seed)
    pushes = SinglePushes(split, kind, seeded)
    trainer = Trainer(network, pushes, seeded, folder / "training.pt")
    examples = make_examples(split.validation.alike, kind.prior, None, config.network)
    course = Course(folder / "course.json", trainer, examples, epochs)
    if len(course.losses) < trainer.epoch:
        raise SystemExit(f"{folder} was cut between state and course; remove it to start anew")
    course.run()
    return course


def show(command: Command, courses: dict[str, Course], split: Split, nothing: float) -> None:
    """Print and write the figures."""
    paper, ours = courses["paper"], courses["ours"]
    best = min(paper.losses)
    place = paper.losses.index(best)
    reached = ours.first(best)
    share = PAPER.epochs / len(paper.seconds)
    took = ours.seconds[reached] if reached is not None else math.inf
    halvings = len(paper.losses) * -(-len(split.train) // PAPER.batch) // PAPER.optimizer.halving
    Console().print(
        f"validation loss of the prior alone {nothing:.3f}; the paper's best {best:.3f} after epoch"
        f" {place + 1}, {paper.losses[-1]:.3f} after epoch {len(paper.losses)}, the learning rate"
        f" halved {halvings} times; ours at its best {min(ours.losses):.3f}\n"
        f"train {len(split.train)}, validation {len(split.validation)} transitions"
    )
    figures = [
        Figure("ours to the paper's best loss", took, "s", at_most=TARGET),
        Figure("ours, all epochs", ours.seconds[-1], "s"),
        Figure("the paper's settings to their best loss", paper.seconds[place], "s"),
        Figure(f"the paper's settings, {len(paper.seconds)} epochs", paper.seconds[-1], "s"),
        Figure("the paper's settings, 8,000 epochs, extrapolated", share * paper.seconds[-1], "s"),
        Figure("ratio, 8,000 epochs to ours", share * paper.seconds[-1] / took, "x"),
        Figure("the paper's best loss", best, ""),
        Figure("the paper's loss after the last of these", paper.losses[-1], ""),
        Figure("our best loss", min(ours.losses), ""),
    ]
    report("Training, processor time on one core", figures, command.out / "report.json")


if __name__ == "__main__":
    main()
