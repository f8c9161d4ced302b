"""Data sets of the whole library of shapes, seen and unseen, and errors of a model on them.

    ./env python -m benchmarks.results.shapes_collect data/shapes --episodes 5000
    ./env python -m benchmarks.results.shapes_learning data/shapes --out runs/shapes
    ./env ros2 run sain_model train runs/shapes/seen --out runs/mine
    ./env python -m benchmarks.results.shapes_learning data/shapes --model sain --out runs/shapes

The folders `seen` and `unseen` below `--out` are data sets. `--model` measures a model on both, of
`seen` on what it has not learned from.
"""

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console

from sain_core.model import load_dynamics
from sain_core.output import write_json
from sain_core.scene import STATE_SIZE
from sain_core.storage import write_arrays
from sain_core.transitions import COLLECTION_FILE, Column, Columns, shard_path
from sain_model.cli.evaluate import unseen
from sain_model.compute.threads import settle_threads
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.load import parse_card
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import SAIN, evaluate
from sain_model.evaluation.presentation import error_tables
from sain_sim.world.truth import RANDOMISED

STATES = ("state", "next_state")


def main() -> None:
    """Write the data sets, and measure; see the module."""
    arguments = parse()
    settle_threads()
    folders, report = as_shards(arguments), {}
    if not arguments.model:
        return
    model = load_dynamics(arguments.model)
    assert isinstance(model, SainDynamics)
    card = parse_card(Path(arguments.model), model.origin.card)
    for folder in folders:
        report[folder.name] = evaluate(unseen(load_dataset(folder), card), {SAIN: model})
        for table in error_tables(report[folder.name]):
            Console(width=160).print(table)
    write_json(arguments.out / "report.json", report)


def parse() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--model", help="name or path of a model to measure")
    parser.add_argument("--episodes", type=int, default=10**9, help="number of first episodes")
    return parser.parse_args()


def as_shards(arguments: argparse.Namespace) -> list[Path]:
    """Write the pushes of a world as data sets, of seen and unseen shapes; return the folders."""
    chunks = [np.load(path) for path in sorted(arguments.data.glob("chunk-?????.npz"))]
    columns = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0].files}
    wanted = columns["episode"] < arguments.episodes
    alone = columns["shapes"][:, 1] == ""
    folders = []
    for folder, kind in (("seen", ~columns["unseen"]), ("unseen", columns["unseen"])):
        path = arguments.out / folder
        path.mkdir(parents=True, exist_ok=True)
        write_json(path / COLLECTION_FILE, {"truth": {"world": RANDOMISED}})
        for count, some in ((1, alone), (2, ~alone)):
            rows = {name: values[wanted & kind & some] for name, values in columns.items()}
            write_arrays(shard_path(path, count), transitions(rows, count))
        folders.append(path)
    return folders


def transitions(rows: Columns, count: int) -> Columns:
    """Return pushes of so many bodies with the columns of a data set."""
    states = (rows[name][:, :count].reshape(-1, count * STATE_SIZE) for name in STATES)
    before, after = states
    kept = (Column.EPISODE, Column.STEP, Column.FRICTION)
    return {
        **dict(zip((Column.STATE, Column.NEXT_STATE), (before, after), strict=True)),
        Column.PHYSICS_NEXT: before,
        Column.ACTION: rows["action"],
        Column.SHAPES: np.array([",".join(names[:count]) for names in rows["shapes"]]),
        Column.ROLES: np.full(len(before), ",".join(["pushable"] * count)),
        **{name: rows[name] for name in kept},
    }


if __name__ == "__main__":
    main()
