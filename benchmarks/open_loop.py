"""What limits open loops: Bullet rolled out, and the truth itself with a model's errors.

./env ros2 run sain_sim collect --world rough --seed 2 --episodes 240 --pushes 20 \
    --out data/rough_open
./env python -m benchmarks.open_loop data/rough_open --learned L --residual R --recurrent C

Everything over the same windows: the first of 15 pushes of every episode that has as many. Three
of the rows need the simulator:

* Bullet with measured masses and radii, the best physics that knows nothing of the lab.
* The truth's own world, set to each scene it predicted: what rounding and warm starts cost.
* That world with an error added after every push, drawn from the residual model's own errors after
  single pushes on these data (of pushes that moved the target, or of those that did not), in
  full and halved. Independent errors, no bias, perfect physics: what is left is how pushes multiply
  an error.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from numpy import ndarray
from rich.console import Console
from rich.progress import track

from sain_core.bootstrap import Interval, bootstrap_mean
from sain_core.errors import SainError
from sain_core.model import Model
from sain_core.push import LENGTH
from sain_core.scene import TARGET
from sain_core.seeding import generator
from sain_core.storage import write_json
from sain_core.types import PushArray, Scene
from sain_model.data.dataset import Dataset, Part, load_dataset
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.load import load_checkpoint
from sain_model.evaluation.errors import (
    LEARNED,
    position_errors,
    target_moved,
)
from sain_model.evaluation.named_models import followed
from sain_model.evaluation.predictors import (
    RECURRENT_SAIN,
    SAIN,
    plain,
    predict_all,
    roll_out,
)
from sain_model.evaluation.tables import markdown_table
from sain_model.network.features import apply_residual, true_residual
from sain_sim.collecting.episode import EpisodeConfig, draw_parameters
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.shadow import MEASURED, TRUE, Bullet, BulletPrior
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import WorldConfig

Predict = Callable[[Scene, PushArray], Scene]


@dataclass(frozen=True)
class Command:
    """What to roll out on what."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A collection that no model was trained on."""
    residual: Path
    """A checkpoint of kind "residual"; its errors are those added to the truth."""
    learned: Path | None = None
    """A checkpoint of kind "learned"."""
    recurrent: Path | None = None
    """A checkpoint of kind "recurrent"."""
    steps: int = 15
    """Pushes of a window."""
    most: int = 100
    """Windows at most."""
    scales: tuple[float, ...] = (0.0, 0.5, 1.0)
    """Times the model's errors that are added to the truth."""
    seed: int = 0
    """Of the errors drawn and of the bootstrap."""
    out: Path | None = None
    """Where the figures are written as JSON."""


def main() -> None:
    """Print mean target errors after 1, 5, 10 and 15 pushes."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=__doc__)
    data = load_dataset(command.dataset).alike
    windows = first_windows(data, command)
    predictions = model_predictions(data, windows, command)
    predictions["bullet, measured"] = bullet_predictions(windows)
    predictions |= truths_with_errors(data, windows, command)
    report = summary(windows, predictions, command.seed)
    print(f"{len(windows)} windows of as many episodes\n")
    show(report)
    if command.out:
        write_json(command.out, report)


def first_windows(data: Part, command: Command) -> Windows:
    """Return the first window of every episode that has one."""
    windows = make_windows(data, command.steps, whole=True)
    _, first = np.unique(windows.episodes, return_index=True)
    starts = data.step[windows.rows[first, 0]] == 0
    return windows.select(first[starts][: command.most])


def model_predictions(data: Part, windows: Windows, command: Command) -> dict[str, ndarray]:
    """Return what planar physics and the models say over these windows."""
    paths = {
        LEARNED: command.learned,
        SAIN: command.residual,
        RECURRENT_SAIN: command.recurrent,
    }
    models: dict[str, Model] = {name: load_checkpoint(path) for name, path in paths.items() if path}
    chosen = Dataset((data.select(np.isin(data.episode, windows.episodes)),))
    (loop,) = predict_all(chosen, models, command.steps)
    at_start = np.flatnonzero(
        (loop.earlier == 0) & np.isin(loop.windows.episodes, windows.episodes)
    )
    order = at_start[np.argsort(loop.windows.episodes[at_start])]
    return {
        name: predicted[order]
        for name, predicted in loop.by_name.items()
        if "history" not in name and np.isfinite(predicted[order]).all()
    }


def bullet_predictions(windows: Windows) -> ndarray:
    """Return what Bullet with measured masses and radii says (W, T, N, 8)."""
    console, pushes = Console(stderr=True), int(np.count_nonzero(windows.pushes[..., LENGTH]))
    with Bullet(MEASURED) as bullet, followed({"bullet": bullet}, pushes, console) as shown:
        return roll_out(plain(shown["bullet"]), windows)


def truths_with_errors(data: Part, windows: Windows, command: Command) -> dict[str, ndarray]:
    """Return rollouts of the truth's own world with a model's errors added after every push."""
    sain = load_checkpoint(command.residual)
    predicted = sain.step(data.state, data.action)
    errors = true_residual(data.next_state, data.action, predicted)
    moved = target_moved(data.state, predicted)
    groups = {flag: errors[moved == flag] for flag in (False, True)}
    found = {}
    for scale in command.scales:

        @contextmanager
        def truth(window: int, scale: float = scale) -> Iterator[Predict]:
            random = generator(command.seed, "errors", window)
            known = parameters(command.dataset, int(windows.episodes[window]))

            def predict(scene: Scene, push: PushArray) -> Scene:
                after = world.predict(scene, push)
                group = groups[bool(target_moved(scene[None], after[None])[0])]
                error = scale * group[random.integers(len(group))]
                return apply_residual(after[None], push[None], error[None])[0]

            with BulletPrior(TRUE, WorldConfig(), known) as world:
                yield predict

        found[f"truth + {scale:g} x errors of single pushes"] = roll(windows, truth)
    return found


def parameters(dataset: Path, episode: int) -> WorldParameters:
    """Return what an episode of a collection was made of."""
    settings = json.loads((dataset / "collection.json").read_text())
    seed, truth = settings.pop("seed"), TruthConfig(**settings.pop("truth", {}))
    config = EpisodeConfig(**settings, truth=truth)
    return draw_parameters(generator(seed, "episode", episode), config)


def roll(windows: Windows, worlds: Callable[[int], AbstractContextManager[Predict]]) -> ndarray:
    """Return rollouts (W, T, N, 8), each in the world of its window.

    A push that the arm cannot carry out in the predicted scene moves nothing: a world refuses it.
    """
    predicted = np.empty_like(windows.next_scenes)
    for window in track(range(len(windows)), console=Console(stderr=True)):
        scene = windows.scenes[window]
        with worlds(window) as predict:
            for step, push in enumerate(windows.pushes[window]):
                with suppress(SainError):
                    scene = predict(scene, push)
                predicted[window, step] = scene
    return predicted


def summary(
    windows: Windows, predictions: dict[str, ndarray], seed: int
) -> dict[str, dict[str, Interval]]:
    """Return mean target errors [mm] after some pushes, with 95 % intervals over episodes."""
    report: dict[str, dict[str, Interval]] = {}
    for name, predicted in predictions.items():
        report[name] = {}
        for step in (1, 5, 10, windows.steps):
            said, truth = predicted[:, step - 1], windows.next_scenes[:, step - 1]
            errors = position_errors(said, truth, TARGET)
            random = generator(seed, "bootstrap")
            report[name][str(step)] = bootstrap_mean(errors, random, windows.episodes)
    return report


def show(report: dict[str, dict[str, Interval]]) -> None:
    """Print the report as a table in Markdown."""
    steps = list(next(iter(report.values())))
    header = ["target mean, mm, after", *(f"{step} pushes" for step in steps)]
    rows = [
        [name, *("{:.2f} [{:.2f}, {:.2f}]".format(*row) for row in rows.values())]
        for name, rows in report.items()
    ]
    print(markdown_table(header, rows), end="")


if __name__ == "__main__":
    main()
