"""SAIN on the whole library of shapes: errors of prior and network, on shapes seen and unseen.

    nice ./env python -m benchmarks.shapes_collect data/shapes --episodes 5000
    nice ./env python -m benchmarks.shapes_learning data/shapes --world rough --out runs/shapes
    nice ./env python -m benchmarks.shapes_learning data/shapes --world rough --model sain \
        --out runs/shipped

Friction is inferred from the episode's earlier pushes, for the baseline and, without
`--no-history`, for SAIN. `--baseline` learns nothing, `--model` measures a model. The folders
`seen` and `unseen` below `--out` are data sets that `ros2 run sain_model train` reads.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from benchmarks.shapes_errors import table
from sain_core.dataset import Column, Columns, shard_path
from sain_core.model import load_dynamics
from sain_core.scene import STATE_SIZE
from sain_core.storage import write_arrays
from sain_model.cli.train import learn
from sain_model.compute.threads import settle_threads
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import load_datasets, split_datasets
from sain_model.dynamics.checkpoint import save_checkpoint
from sain_model.dynamics.priors import load_planar
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import PLANAR, PLANAR_PRIORS, LossConfig
from sain_model.evaluation.shape_errors import figures, measure_bodies
from sain_model.network.settings import PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.training.options import TrainOptions
from sain_model.training.settings import EPISODE, NOTHING, TrainingConfig
from sain_model.training.training_card import make_card
from sain_model.training.training_loop import LossHistory

STATES = ("state", "next_state")


def main() -> None:
    """Learn and measure; see the module."""
    arguments = parse()
    settle_threads()
    seen, unseen = (load_datasets([path]) for path in as_shards(arguments))
    split = split_datasets(seen, 0, 0.1, 0.15)
    prior = load_planar(arguments.prior)
    friction = make_filter(prior, split.train)
    assert friction is not None
    print(friction.config, *(len(part) for part in vars(split).values()), len(unseen), flush=True)
    infers = None if arguments.no_history else friction
    sain: SainDynamics | None = None
    histories: list[LossHistory] = []
    command = options(arguments, infers is not None)
    if arguments.model:
        model = load_dynamics(arguments.model)
        assert isinstance(model, SainDynamics)
        sain = model
    elif not arguments.baseline:
        sain, histories = learn(command, seen, split, Console(), physics=(prior, infers))
    report = {}
    for name, test in {"seen": split.test, "unseen": unseen}.items():
        print(f"\n## {name}, {arguments.prior}\n\n{table(measure_bodies(prior, None, test))}")
        rows = measure_bodies(friction, sain, test)
        report[name] = figures({key: values[rows["pushed"]] for key, values in rows.items()})
        print(f"\n## {arguments.world}, {name} shapes\n\n{table(rows)}", flush=True)
    (arguments.out / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    if sain is not None and histories:
        card = make_card(command, seen, split, sain, histories, report, None)
        told = " ".join(["python -m benchmarks.shapes_learning", *sys.argv[1:]])
        path = arguments.out / f"{arguments.name}.safetensors"
        save_checkpoint(path, sain.network, replace(card, command=told))


def parse() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--name", default="sain", help="of the checkpoint")
    parser.add_argument("--prior", choices=PLANAR_PRIORS, default=PLANAR)
    parser.add_argument("--model", help="name or path of a model; nothing is learned")
    parser.add_argument("--world", choices=("randomised", "rough"), default="rough")
    parser.add_argument("--frame", choices=(PUSH_FRAME, WORLD_FRAME))
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--members", type=int, default=3)
    parser.add_argument("--hidden", type=int, default=128)
    parser.add_argument("--layers", type=int, default=2)
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--decay", type=float, default=0.01)
    parser.add_argument("--episodes", type=int, default=10**9, help="number of first episodes")
    parser.add_argument("--baseline", action="store_true")
    parser.add_argument("--no-history", action="store_true", help="friction is not inferred")
    return parser.parse_args()


def as_shards(arguments: argparse.Namespace) -> list[Path]:
    """Write the pushes of a world as data sets, of seen and unseen shapes; return the folders."""
    chunks = [np.load(path) for path in sorted(arguments.data.glob("chunk-?????.npz"))]
    columns = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0].files}
    wanted = columns["rough"] == (arguments.world == "rough")
    wanted &= columns["episode"] < arguments.episodes
    alone = columns["shapes"][:, 1] == ""
    folders = []
    for folder, kind in (("seen", ~columns["unseen"]), ("unseen", columns["unseen"])):
        path = arguments.out / folder
        path.mkdir(parents=True, exist_ok=True)
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


def options(arguments: argparse.Namespace, infers: bool) -> TrainOptions:
    """Return the settings of a training; with `infers`, friction is inferred from history."""
    frame = arguments.frame or (WORLD_FRAME if arguments.world == "rough" else PUSH_FRAME)
    network = NetworkConfig(
        features=frame,
        members=arguments.members,
        hidden=arguments.hidden,
        message=arguments.hidden // 2,
        layers=arguments.layers,
    )
    smooth = arguments.world != "rough"
    loss = LossConfig(position_scale=0.0002, heading_scale=0.01) if smooth else LossConfig()
    training = TrainingConfig(
        epochs=arguments.epochs,
        batch=arguments.batch,
        learning_rate=arguments.rate,
        network=network,
        loss=loss,
        weight_decay=arguments.decay,
        prior=arguments.prior,
        history=EPISODE if infers else NOTHING,
    )
    return TrainOptions((arguments.data,), arguments.out, arguments.name, training=training)


if __name__ == "__main__":
    main()
