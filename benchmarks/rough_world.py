"""What a residual is worth in a world with structure that the prior does not have.

ros2 run sain_sim collect --world rough --seed 1 --episodes 560 --floor-episodes 80 --out data/rough
./env python -m benchmarks.rough_world data/rough --sizes 300 1000 3000

For one collection: the errors of every physics prior, of the network alone and of SAIN on held-out
episodes, and the ratios of their means with 95 % bootstrap intervals over episodes. Every network
gets the same number of steps, and the epoch that does best on the validation episodes.
"""

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from rich.console import Console

from sain_core.dynamics import Dynamics
from sain_core.scene import POSITION, TARGET
from sain_core.seeding import generator
from sain_model.checkpoint import write_whole
from sain_model.dataset import (
    Split,
    Transitions,
    limit_training,
    load_transitions,
    split_by_episode,
)
from sain_model.features import FRAMES, PUSH_FRAME
from sain_model.load import load_prior
from sain_model.network import NetworkConfig
from sain_model.planar import PlanarConfig, PlanarPrior
from sain_model.sain import SainDynamics
from sain_model.training import Trainer, TrainingConfig
from sain_sim.shadow import MEASURED, BulletPrior

FRICTIONS = np.arange(0.06, 0.245, 0.01)  # tried for the prior whose friction is fitted
RESAMPLES = 2000
BATCH = 64


@dataclass(frozen=True)
class Command:
    """What to compare on what."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A collection."""
    sizes: tuple[int, ...] = ()
    """Numbers of transitions to train on; none: all there are."""
    steps: int = 4000
    """Steps of the optimiser for every network."""
    seed: int = 0
    """Of the split and of training."""
    test: float = 0.15
    """Share of the episodes held out."""
    prior_friction: float = 0.12
    """What the planar prior under the network assumes."""
    frames: tuple[str, ...] = FRAMES
    """What the networks see: the scene as the push sees it, or the world too."""
    out: Path | None = None
    """Where the figures are written as JSON."""


def main() -> None:
    """Print the table of one collection."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=main.__doc__)
    split = split_by_episode(load_transitions(command.dataset), command.seed, 0.1, command.test)
    errors = physics_errors(split)
    best = min((name for name in errors if name.startswith(("planar", "bullet"))),
               key=lambda name: float(np.nanmean(errors[name])))  # fmt: skip
    for size in command.sizes or (len(split.train),):
        part = limit_training(split, size)
        for frame in command.frames:
            for prior, name in (("identity", "learned only"), ("planar", "SAIN")):
                label = f"{name}, {frame}, {size}"
                errors[label] = network_errors(part, prior, frame, command)
    report = {"dataset": str(command.dataset), "train": len(split.train), "best physics": best}
    report |= summary(errors, split.test.episodes, best)
    show(report)
    if command.out:
        write_whole(command.out, (json.dumps(report, indent=2) + "\n").encode())


def physics_errors(split: Split) -> dict[str, np.ndarray]:
    """Return the target's errors (M,) [mm] of what knows no data but one fitted friction."""
    train, test = split.train, split.test
    fitted = min(FRICTIONS, key=lambda value: float(target_errors(train, planar(value)).mean()))
    with BulletPrior(MEASURED) as bullet:
        measured = bullet.step(test.scenes, test.pushes)
    return {
        "no motion": distances(test.scenes, test),
        "bullet, nominal: f_p": distances(test.physics_next, test),
        "bullet, measured": distances(measured, test),
        "planar, measured, 0.12": target_errors(test, planar(0.12)),
        "planar, measured, 0.14": target_errors(test, planar(0.14)),
        f"planar, measured, fitted {fitted:.2f}": target_errors(test, planar(float(fitted))),
        "floor": distances(test.floor_next, test),
    }


def network_errors(split: Split, prior_name: str, frame: str, command: Command) -> np.ndarray:
    """Train a network on a prior and return its errors (M,) [mm] on what is held out."""
    settings = {"friction": command.prior_friction} if prior_name == "planar" else None
    prior = load_prior(prior_name, settings)
    rows = len(split.train) * (2 if frame == PUSH_FRAME else 1)  # mirrored copies
    config = TrainingConfig(
        seed=command.seed,
        batch=BATCH,
        epochs=max(round(command.steps * BATCH / rows), 1),
        prior=prior_name,
        network=NetworkConfig(features=frame),
    )
    with tempfile.TemporaryDirectory() as folder:
        trainer = Trainer(split, prior, config, Path(folder))
        trainer.run()
    return target_errors(split.test, SainDynamics(trainer.network, prior, prior_name))


def planar(friction: float) -> PlanarPrior:
    """Return the planar prior with this friction; it is told masses and radii."""
    return PlanarPrior(PlanarConfig(friction=friction))


def target_errors(data: Transitions, dynamics: Dynamics) -> np.ndarray:
    """Return how far off the target's predicted positions are, (M,) [mm]."""
    return distances(dynamics.step(data.scenes, data.pushes), data)


def distances(predicted: np.ndarray, data: Transitions) -> np.ndarray:
    """Return the distances (M,) [mm] of targets predicted and targets seen."""
    missing = predicted[:, TARGET, POSITION] - data.next_scenes[:, TARGET, POSITION]
    return np.asarray(1e3 * np.linalg.norm(missing, axis=-1))


def summary(errors: dict[str, np.ndarray], episodes: np.ndarray, best: str) -> dict[str, object]:
    """Return means, and ratios of means to the best physics prior and to the network alone."""
    rows = {}
    for name, values in errors.items():
        row: dict[str, object] = {"mean": float(np.nanmean(values))}
        if name.startswith(("SAIN", "learned")):
            row["to physics"] = ratio(values, errors[best], episodes)
        if name.startswith("SAIN"):
            alone = errors[name.replace("SAIN", "learned only")]
            row["to learned only"] = ratio(values, alone, episodes)
        rows[name] = row
    return {"errors": rows, "held out": len(episodes), "episodes": len(np.unique(episodes))}


def ratio(above: np.ndarray, below: np.ndarray, episodes: np.ndarray) -> list[float]:
    """Return the ratio of two means and its 95 % interval when episodes are drawn again."""
    _, place = np.unique(episodes, return_inverse=True)
    first, second = np.bincount(place, above), np.bincount(place, below)
    drawn = generator(0, "ratio").integers(len(first), size=(RESAMPLES, len(first)))
    ratios = first[drawn].sum(axis=1) / second[drawn].sum(axis=1)
    low, high = np.quantile(ratios, [0.025, 0.975])
    return [float(above.sum() / below.sum()), float(low), float(high)]


def show(report: dict[str, object]) -> None:
    """Print the report as a table in Markdown."""
    console = Console(width=140, highlight=False)
    console.print(
        f"{report['dataset']}: {report['train']} to train on, held out {report['held out']}"
        f" of {report['episodes']} episodes; best physics: {report['best physics']}\n"
    )
    console.print("| prediction | target mean, mm | to best physics | to learned only |")
    console.print("| --- | ---: | ---: | ---: |")
    for name, row in report["errors"].items():  # type: ignore[attr-defined]
        cells = [_interval(row.get(key)) for key in ("to physics", "to learned only")]
        console.print(f"| {name} | {row['mean']:.2f} | {' | '.join(cells)} |", markup=False)


def _interval(values: list[float] | None) -> str:
    return "{:.2f} [{:.2f}, {:.2f}]".format(*values) if values else ""


if __name__ == "__main__":
    main()
