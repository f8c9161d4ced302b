"""What fine-tuning brings in worlds that the shipped checkpoint was not trained for.

benchmarks/fine_tuning.sh runs/worlds                                 # records them, on the graph
./env python -m benchmarks.fine_tuning runs/worlds --old data/randomised --out runs/worlds.json

For each world: errors of the target after one push, on episodes that were recorded by themselves,
for physics, for the shipped checkpoint, and for what is learned from one, two and more of the
other recordings, going on with it or from new weights. All are told the friction that the
episode's earlier pushes show, as in deployment. Prior, features, loss, data and split are the
same; new weights get the shipped model's learning rate, and as many epochs as they are given here.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import torch
import tyro

from sain_core.bootstrap import bootstrap_mean, bootstrap_ratio
from sain_core.scene import TARGET
from sain_core.seeding import generator
from sain_core.storage import write_json
from sain_core.types import Scalars
from sain_model.cli.evaluate import unseen
from sain_model.data.dataset import Part, Split, load_dataset, split_by_episode
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import SHIPPED
from sain_model.evaluation.errors import position_errors
from sain_model.evaluation.predictors import (
    predict_with_history,
    step_with_history,
)
from sain_model.evaluation.tables import markdown_table
from sain_model.training.fine_tuning import Parent
from sain_model.training.fit import fit

BULLET, PRIOR, AS_SHIPPED = "Bullet, nominal: f_p", "its prior", "SAIN as shipped"
TUNED, SCRATCH = "fine-tuned", "from new weights"
COLUMNS: Final = (
    "learned from",
    "target mean, mm",
    "to shipped",
    "to new weights",
    "median",
    "regions hold",
    "old world",
)


@dataclass(frozen=True)
class Command:
    """What to compare on what."""

    recordings: Annotated[Path, tyro.conf.Positional]
    """Folder that benchmarks/fine_tuning.sh has filled."""
    worlds: tuple[str, ...] = ("cube", "rims", "rubber")
    """Which of its worlds."""
    bags: tuple[int, ...] = (1, 2, 4)
    """Numbers of recordings to learn from."""
    scratch_epochs: int = 200
    """For new weights."""
    rates: tuple[float, ...] = ()
    """Learning rates to fine-tune at; none: the usual one."""
    seed: int = 0
    """Of training, and of what validates."""
    old: Path | None = None
    """The collection that the shipped checkpoint learned from, to see what is forgotten."""
    out: Path | None = None
    """Where the figures are written as JSON."""


def main() -> None:
    """Print a table for each world."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=__doc__)
    parent = Parent.load(SHIPPED)
    old = unseen(load_dataset(command.old), parent.card).alike if command.old else None
    report = {}
    for world in command.worlds:
        report[world] = compare(command, world, parent, old)
        show(world, report[world])
    if command.out:
        write_json(command.out, report)


def compare(command: Command, world: str, parent: Parent, old: Part | None) -> dict[str, Any]:
    """Return the rows of a world's table."""
    data = command.recordings / "data"
    test = load_dataset(data / f"{world}_test").alike
    shipped = target_errors(parent.sain, test)
    rows = [
        row(BULLET, position_errors(test.physics_next, test.next_state, TARGET), shipped, test),
        row(PRIOR, target_errors(parent.sain, test, corrected=False), shipped, test),
        model_row(AS_SHIPPED, parent.sain, shipped, test, old),
    ]
    for bags in command.bags:
        seen = load_dataset(*(data / f"{world}_{bag + 1}" for bag in range(bags)))
        split = split_by_episode(seen, command.seed, parent.settings.validation, 0.0)
        learned = {
            f"{TUNED}{f' at {rate:g}' if command.rates else ''}": train(
                split, parent, command, rate
            )
            for rate in command.rates or (parent.settings.learning_rate,)
        }
        learned[SCRATCH] = train(split, parent, command)
        scratch = target_errors(learned[SCRATCH], test)
        for name, model in learned.items():
            about: dict[str, Any] = {"bags": bags, "transitions": len(seen)}
            if name != SCRATCH:
                errors = target_errors(model, test)
                about["to new"] = bootstrap_ratio(
                    errors, scratch, generator(0, "ratio"), test.episode
                )
            rows.append(about | model_row(name, model, shipped, test, old))
    episodes = len(np.unique(test.episode))
    return {"held out": len(test), "episodes": episodes, "rows": rows}


def train(
    split: Split, parent: Parent, command: Command, rate: float | None = None
) -> SainDynamics:
    """Go on with the parent at a learning rate; without one, start from new weights at its own."""
    config = replace(parent.settings, seed=command.seed, test=0.0)
    if rate is None:
        own = parent.card.training["learning_rate"]
        config = replace(config, learning_rate=own, epochs=command.scratch_epochs)
    else:
        config = replace(config, learning_rate=rate)
    start = None if rate is None else parent.sain
    kind = parent.sain.belief.trained
    with tempfile.TemporaryDirectory() as folder:
        model, _ = fit(split, kind, config, Path(folder), start=start)
    return model


def target_errors(sain: SainDynamics, data: Part, corrected: bool = True) -> Scalars:
    """Return how far off the target is (M,) [mm]: of the model, or of its prior alone."""
    predicted = step_with_history(sain if corrected else sain.physics_alone(), data)
    return position_errors(predicted, data.next_state, TARGET)


def model_row(
    name: str, sain: SainDynamics, shipped: Scalars, test: Part, old: Part | None
) -> dict[str, Any]:
    """Return the row of a model, with its regions and what it errs by in the old world."""
    errors, radius = target_errors(sain, test), predict_with_history(sain, test).radius
    told = row(name, errors, shipped, test)
    if radius is not None:
        told["regions"] = float((errors <= 1e3 * radius[:, TARGET]).mean())
    if old is not None:
        told["old"] = float(target_errors(sain, old).mean())
    return told


def row(name: str, errors: Scalars, shipped: Scalars, test: Part) -> dict[str, Any]:
    """Return mean, median and ratio to the shipped model, with 95 % intervals over episodes."""
    return {
        "name": name,
        "mean": bootstrap_mean(errors, generator(0, "ratio"), test.episode),
        "to shipped": bootstrap_ratio(errors, shipped, generator(0, "ratio"), test.episode),
        "median": float(np.median(errors)),
    }


def show(world: str, report: dict[str, Any]) -> None:
    """Print a world's table in Markdown."""
    print(f"\n{world}: {report['held out']} pushes of {report['episodes']} episodes held out\n")
    cells = [
        [
            one["name"],
            f"{one['transitions']:,} pushes, {one['bags']} bags" if "bags" in one else "",
            "{:.2f} [{:.2f}, {:.2f}]".format(*one["mean"]),
            "{:.2f} [{:.2f}, {:.2f}]".format(*one["to shipped"]),
            "{:.2f} [{:.2f}, {:.2f}]".format(*one["to new"]) if "to new" in one else "",
            f"{one['median']:.2f}",
            f"{100 * one['regions']:.0f} %" if "regions" in one else "",
            f"{one['old']:.2f}" if "old" in one else "",
        ]
        for one in report["rows"]
    ]
    print(markdown_table(["prediction", *COLUMNS], cells), end="", flush=True)


if __name__ == "__main__":
    main()
