"""Do averages of rollouts err less than single ones? More data, several models, many particles.

./env python -m benchmarks.rollout_designs data/rough_open --trained-on data/rough \
    --models runs/rough/learned/sain.safetensors runs/rough/residual/sain.safetensors

For each model: its rollouts; the mean of many, each with errors added after every push that are
drawn from the model's own on its validation episodes (particles); and the mean over all models'.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from numpy import ndarray
from rich.console import Console

from sain_core.bootstrap import bootstrap_mean
from sain_core.model import Model
from sain_core.scene import TARGET
from sain_core.seeding import generator
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Part, load_dataset, split_by_episode
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.checkpoint import parse_card
from sain_model.dynamics.load import load_checkpoint
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import position_errors, target_moved
from sain_model.evaluation.predictors import plain, roll_out
from sain_model.network.features import apply_residual, true_residual


@dataclass(frozen=True)
class Command:
    """What to roll out on what."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A collection that no model was trained on."""
    trained_on: Path
    """The collection that the models were trained on: their errors are taken there."""
    models: tuple[Path, ...]
    """Checkpoints."""
    particles: int = 16
    """Rollouts that are averaged."""
    steps: tuple[int, ...] = (1, 5, 15)
    """After how many pushes errors are taken."""
    seed: int = 0
    """Of the particles and of the bootstrap."""


class Particles(Model):
    """A model with errors of its own kind added after every push."""

    def __init__(self, sain: SainDynamics, validation: Part, random: np.random.Generator) -> None:
        predicted = sain.step(validation.state, validation.action)
        errors = true_residual(validation.next_state, validation.action, predicted)
        moved = target_moved(validation.state, predicted)
        self._groups = [errors[moved == flag] for flag in (False, True)]
        self._sain, self._random = sain, random

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        after = self._sain.step(scenes, pushes)
        drawn = [
            group[self._random.integers(len(group), size=len(pushes))] for group in self._groups
        ]
        moved = target_moved(scenes, after)
        return apply_residual(after, pushes, np.where(moved[:, None, None], drawn[1], drawn[0]))


def main() -> None:
    """Print mean target errors."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=__doc__)
    windows = make_windows(load_dataset(command.dataset).alike, max(command.steps))
    console = Console(width=160, highlight=False)
    heads = " | ".join(f"{step} pushes" for step in command.steps)
    console.print(f"| target mean, mm, after | {heads} |\n| --- |{' ---: |' * len(command.steps)}")
    means = []
    for path in command.models:
        means.append(roll_out(plain(load_checkpoint(path)), windows))
        show(console, str(path), windows, means[-1], command)
        show(console, f"mean of {command.particles} particles", windows,
             particles(path, windows, command), command)  # fmt: skip
    if len(means) > 1:
        show(console, "mean of all models", windows, np.mean(means, axis=0), command)


def particles(path: Path, windows: Windows, command: Command) -> ndarray:
    """Return the mean (W, T, N, 8) of rollouts with a model's own errors."""
    sain = load_checkpoint(path)
    assert isinstance(sain, SainDynamics)
    training = parse_card(path, sain.origin.card).training
    shares = training["validation"], training["test"]
    data = load_dataset(command.trained_on)
    validation = split_by_episode(data, training["seed"], *shares).validation.alike
    random = generator(command.seed, "particles")
    model = Particles(sain, validation, random)
    rollouts = [roll_out(plain(model), windows) for _ in range(command.particles)]
    return np.asarray(np.mean(rollouts, axis=0))


def show(
    console: Console, name: str, windows: Windows, predicted: ndarray, command: Command
) -> None:
    """Print a line of the table."""
    cells = []
    for step in command.steps:
        rows = windows.known[:, step - 1]
        truth = windows.next_scenes[rows, step - 1]
        errors = position_errors(predicted[rows, step - 1], truth, TARGET)
        random = generator(command.seed, "bootstrap")
        mean, low, high = bootstrap_mean(errors, random, windows.episodes[rows])
        cells.append(f"{mean:.2f} [{low:.2f}, {high:.2f}]")
    console.print(f"| {name} | {' | '.join(cells)} |", markup=False)


if __name__ == "__main__":
    main()
