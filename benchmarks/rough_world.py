"""What a residual is worth in a world with structure that the prior does not have.

./env ros2 run sain_sim collect --world rough --seed 1 --episodes 560 --floor-episodes 80 \
    --out data/rough
./env python -m benchmarks.rough_world data/rough --sizes 300 1000 3000

For one collection: the errors of every physics prior, of the network alone, of SAIN and of SAIN
inside physics on held-out episodes, and the ratios of their means with 95 % bootstrap intervals
over episodes. All networks are as wide; the network alone and SAIN get `--steps` steps, the one
inside physics `--inside-steps`, and all the weights that do best on the validation episodes.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro

from benchmarks.identification import identify
from sain_core.bootstrap import Interval, bootstrap_ratio
from sain_core.model import Model
from sain_core.scene import TARGET
from sain_core.seeding import generator
from sain_core.storage import write_json
from sain_model.data.dataset import (
    Part,
    Split,
    check_held_out,
    limit_training,
    load_dataset,
    split_by_episode,
)
from sain_model.dynamics.priors import load_planar, make_prior
from sain_model.dynamics.settings import IDENTITY, PLANAR, PLANAR_AXES
from sain_model.evaluation.errors import position_errors
from sain_model.evaluation.predictors import FLOOR, LEARNED, NO_MOTION, SAIN
from sain_model.evaluation.tables import markdown_table
from sain_model.inference.kinds import friction_kind
from sain_model.network.corrections import corrected_values
from sain_model.network.settings import PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.physics.planar_config import AXES
from sain_model.training.fit import fit
from sain_model.training.settings import OF_PARAMETERS, TrainingConfig
from sain_sim.world.shadow import MEASURED, BulletPrior

FRICTIONS = np.arange(0.06, 0.245, 0.01)  # tried for the prior whose friction is fitted
BATCH = 64
RATIOS = ("to physics", "to learned only", "to learned only with the next size")
PARAMETER_CORRECTION, IDENTIFIED = "SAIN inside", "physics, identified"


@dataclass(frozen=True)
class Command:
    """What to compare on what."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A collection."""
    sizes: tuple[int, ...] = ()
    """Numbers of transitions to train on; none: all there are."""
    steps: int = 6000
    """Steps of the optimiser for the network alone and for SAIN."""
    inside_steps: int = 2000
    """And for SAIN inside physics."""
    hidden: int = 128
    """Width of the hidden layers of every network."""
    members: int = 1
    """Networks of each kind, whose predictions are averaged."""
    seed: int = 0
    """Of the split and of training."""
    test: float = 0.15
    """Share of the episodes held out."""
    prior: str = PLANAR_AXES
    """The prior under the networks."""
    prior_friction: float = 0.12
    """What it assumes."""
    frames: tuple[str, ...] = (WORLD_FRAME,)
    """What the networks see: the scene as the push sees it, or the world too."""
    out: Path | None = None
    """Where the figures are written as JSON."""


def main() -> None:
    """Print the table of one collection."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=main.__doc__)
    split = split_by_episode(load_dataset(command.dataset), command.seed, 0.1, command.test)
    check_held_out(split)
    errors = physics_errors(split)
    best = min((name for name in errors if name.startswith(("planar", "bullet"))),
               key=lambda name: float(np.nanmean(errors[name])))  # fmt: skip
    sizes = command.sizes or (len(split.train),)
    for size in sizes:
        part = limit_training(split, size)
        for frame in command.frames:
            for prior, name in ((IDENTITY, LEARNED), (command.prior, SAIN)):
                label = f"{name}, {frame}, {size}"
                errors[label] = network_errors(part, prior, frame, command)
        errors[f"{IDENTIFIED}, {size}"] = identified_errors(part, command)
        errors[f"{PARAMETER_CORRECTION}, {WORLD_FRAME}, {size}"] = inside_errors(part, command)
    report = {"dataset": str(command.dataset), "train": len(split.train), "best physics": best}
    report |= summary(errors, split.test.episode, best, sizes)
    show(report)
    if command.out:
        write_json(command.out, report)


def physics_errors(split: Split) -> dict[str, np.ndarray]:
    """Return the target's errors (M,) [mm] of what knows no data but one fitted friction."""
    train, test = split.train.alike, split.test.alike
    with BulletPrior(MEASURED) as bullet:
        measured = bullet.step(test.state, test.action)
    errors = {
        NO_MOTION: target_distances(test.state, test),
        "bullet, nominal: f_p": target_distances(test.physics_next, test),
        "bullet, measured": target_distances(measured, test),
    }
    for name, config in ((PLANAR, PlanarConfig()), (PLANAR_AXES, AXES)):
        prior = PlanarPrior(config)
        fitted = min(FRICTIONS, key=lambda value: target_errors(train, _at(prior, value)).mean())
        for friction, note in ((0.12, ""), (0.14, ""), (float(fitted), "fitted ")):
            label = f"{name}, measured, {note}{friction:.2f}"
            errors[label] = target_errors(test, _at(prior, friction))
    errors[FLOOR] = target_distances(test.floor_next, test)
    return errors


def _at(prior: PlanarPrior, friction: float) -> PlanarPrior:
    return replace(prior, config=replace(prior.config, friction=friction))


def network_errors(split: Split, prior_name: str, frame: str, command: Command) -> np.ndarray:
    """Train networks on a prior and return their errors (M,) [mm] on what is held out."""
    settings = None if prior_name == IDENTITY else {"friction": command.prior_friction}
    kind = friction_kind(make_prior(prior_name, settings), infers=False)
    rows = len(split.train) * (2 if frame == PUSH_FRAME else 1)  # mirrored copies
    predicted, test = [], split.test.alike
    for member in range(command.members):
        config = TrainingConfig(
            seed=command.seed + member,
            batch=BATCH,
            epochs=max(round(command.steps * BATCH / rows), 1),
            prior=prior_name,
            network=NetworkConfig(features=frame, hidden=command.hidden),
        )
        with tempfile.TemporaryDirectory() as folder:
            model, _ = fit(split, kind, config, Path(folder))
        predicted.append(model.step(test.state, test.action))
    return target_distances(np.mean(predicted, axis=0), test)  # of headings no mean is asked


def inside_errors(split: Split, command: Command) -> np.ndarray:
    """Train networks inside a prior and return their errors (M,) [mm] on what is held out."""
    prior = load_planar(command.prior, {"friction": command.prior_friction})
    kind = friction_kind(prior, infers=False)
    network = replace(OF_PARAMETERS.network, hidden=command.hidden, members=command.members)
    config = replace(
        OF_PARAMETERS,
        seed=command.seed,
        epoch_steps=command.inside_steps // OF_PARAMETERS.epochs,
        prior=command.prior,
        network=network,
    )
    with tempfile.TemporaryDirectory() as folder:
        model, _ = fit(split, kind, config, Path(folder))
    return target_errors(split.test.alike, model)


def identified_errors(split: Split, command: Command) -> np.ndarray:
    """Return the errors (M,) [mm] of the prior that is told the same of every push."""
    prior, test = load_planar(command.prior, {"friction": command.prior_friction}), split.test.alike
    told = np.tile(identify(prior, split.train.alike), (len(test), 1, 1))
    values = corrected_values(told, test.action, prior.config)
    return target_distances(prior.step(test.state, test.action, values), test)


def target_errors(data: Part, dynamics: Model) -> np.ndarray:
    """Return how far off the target's predicted positions are, (M,) [mm]."""
    return target_distances(dynamics.step(data.state, data.action), data)


def target_distances(predicted: np.ndarray, data: Part) -> np.ndarray:
    """Return the distances (M,) [mm] of targets predicted and targets seen."""
    return position_errors(predicted, data.next_state, TARGET)


def summary(
    errors: dict[str, np.ndarray], episodes: np.ndarray, best: str, sizes: tuple[int, ...]
) -> dict[str, object]:
    """Return means, and ratios of means to the best physics prior and to the network alone."""
    rows = {}

    def ratio(above: np.ndarray, below: np.ndarray) -> Interval:
        known = np.isfinite(above)
        random = generator(0, "ratio")
        return bootstrap_ratio(above[known], below[known], random, episodes[known])

    for name, values in errors.items():
        mean, *interval = ratio(values, np.ones(len(values)))
        row: dict[str, object] = {"mean": mean, "interval": interval}
        if name.startswith((SAIN, LEARNED, IDENTIFIED)):
            row["to physics"] = ratio(values, errors[best])
        if name.startswith(SAIN):
            alone = errors[name.replace(PARAMETER_CORRECTION, LEARNED).replace(SAIN, LEARNED)]
            row["to learned only"] = ratio(values, alone)
            following = sizes[sizes.index(int(name.split(", ")[-1])) + 1 :][:1]
            for size in following:
                other = errors[f"{LEARNED}, {name.split(', ')[1]}, {size}"]
                row["to learned only with the next size"] = ratio(values, other)
        rows[name] = row
    return {"errors": rows, "held out": len(episodes), "episodes": len(np.unique(episodes))}


def show(report: dict[str, object]) -> None:
    """Print the report as a table in Markdown."""
    print(
        f"{report['dataset']}: {report['train']} to train on, held out {report['held out']}"
        f" of {report['episodes']} episodes; best physics: {report['best physics']}\n"
    )
    rows = [
        [name, f"{row['mean']:.2f}", *(_interval(row.get(key)) for key in RATIOS)]
        for name, row in report["errors"].items()  # type: ignore[attr-defined]
    ]
    print(markdown_table(["prediction", "target mean, mm", *RATIOS], rows), end="")


def _interval(values: list[float] | None) -> str:
    return "{:.2f} [{:.2f}, {:.2f}]".format(*values) if values else ""


if __name__ == "__main__":
    main()
