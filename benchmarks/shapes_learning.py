"""SAIN on the whole library of shapes: errors of prior and network, on shapes seen and unseen.

    nice ./env python -m benchmarks.shapes_collect data/shapes --episodes 5000
    nice ./env python -m benchmarks.shapes_learning data/shapes --world rough --out runs/shapes
    nice ./env python -m benchmarks.shapes_learning data/shapes --world rough --model sain \
        --out runs/shipped

Friction is inferred from the episode's earlier pushes, for the baseline and, without
`--no-history`, for SAIN. `--baseline` learns nothing, `--model` measures a model.
"""

import argparse
import hashlib
import json
import sys
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.shapes_errors import Rows, measure, summary, table
from sain_core.dataset import draw_parts
from sain_core.plugins import load_dynamics
from sain_core.shapes.bodies import Bodies
from sain_model.compute.threads import settle_threads
from sain_model.data.dataset import Dataset
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.checkpoint import ModelCard, save_checkpoint
from sain_model.dynamics.priors import load_planar, prior_settings
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import PLANAR, PLANAR_LAB, PLANAR_PRIORS, LossConfig
from sain_model.network.settings import ANY_SHAPE, PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior
from sain_model.training.interval_fit import fit_intervals
from sain_model.training.lab_fit import fit_lab
from sain_model.training.push_training import Trainer
from sain_model.training.settings import EPISODE, NOTHING, TrainingConfig
from sain_model.training.training_card import data_part, environment

IDENTIFIED_BY = 300  # combinations of shapes with an earlier episode than this fit the prior


def main() -> None:
    """Learn and measure; see the module."""
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
    parser.add_argument("--identify", action="store_true", help="fit the prior to the laboratory")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    settle_threads()
    split, unseen = load(arguments.data, arguments.world == "rough", arguments.episodes)
    usual = prior = load_planar(arguments.prior)
    if arguments.identify:
        known = [part for part in split.train.parts if part.episode.min() < IDENTIFIED_BY]
        prior = fit_lab(known, usual.config)
        print(prior.centre, prior.config.friction, prior.config.disk_friction, flush=True)
    baseline, friction = make_filter(usual, split.train), make_filter(prior, split.train)
    assert friction is not None
    assert baseline is not None
    print(friction.config, *(len(part) for part in vars(split).values()), len(unseen), flush=True)
    tests = {"seen": split.test, "unseen": unseen}
    sain: SainDynamics | None = None
    if arguments.model:
        model = load_dynamics(arguments.model)
        assert isinstance(model, SainDynamics)
        sain = model
    elif not arguments.baseline:
        sain = learn(arguments, split, prior, None if arguments.no_history else friction)
    report = {}
    for name, test in tests.items():
        if arguments.identify:
            print(f"\n## {name}, identified prior\n\n{table(measure(friction, None, test))}")
        for physics in dict.fromkeys((usual, prior)):
            rows = measure(physics, None, test)
            print(f"\n## {name}, {type(physics).__name__} without history\n\n{table(rows)}")
        rows = measure(baseline, sain, test)
        report[name] = summary(rows)
        print(f"\n## {arguments.world}, {name} shapes\n\n{table(rows)}", flush=True)
    (arguments.out / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    if sain is not None and not arguments.model:
        save(arguments, split, sain, report)


def save(
    arguments: argparse.Namespace, split: MixedSplit, sain: SainDynamics, errors: dict[str, Any]
) -> None:
    """Write the checkpoint and its card."""
    card = ModelCard(
        sain.prior_name,
        prior_settings(sain.prior),
        {},
        friction=asdict(sain.friction) if sain.friction else None,
        intervals=asdict(sain.intervals) if sain.intervals else None,
        kind=sain.kind,
        data=data_part([arguments.data], split.train, split),
        training=asdict(training_config(arguments, sain.friction is not None)),
        errors=errors,
        versions=environment(),
        command=" ".join(["python -m benchmarks.shapes_learning", *sys.argv[1:]]),
    )
    save_checkpoint(arguments.out / f"{arguments.name}.safetensors", sain.network, card)


def load(folder: Path, rough: bool, episodes: int) -> tuple[MixedSplit, MixedDataset]:
    """Return the pushes on seen shapes, split by episode, and those on unseen shapes."""
    chunks = [np.load(path) for path in sorted(folder.glob("chunk-?????.npz"))]
    columns = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0].files}
    wanted = (columns["rough"] == rough) & (columns["episode"] < episodes)
    columns = {name: values[wanted] for name, values in columns.items()}
    unseen = columns["unseen"]
    seen = mixed({name: values[~unseen] for name, values in columns.items()})
    split = MixedSplit(*(seen.select(rows) for rows in draw_parts(seen.episode, 0, 0.1, 0.15)))
    return split, mixed({name: values[unseen] for name, values in columns.items()})


def mixed(columns: Rows) -> MixedDataset:
    """Return one part for every combination of shapes."""
    names = ["|".join(row) for row in columns["shapes"]]
    order = sorted(range(len(names)), key=lambda index: (names[index], index))
    parts = []
    for name, group in groupby(order, key=lambda index: names[index]):
        rows, shapes = list(group), [shape for shape in name.split("|") if shape]
        state, after = (columns[key][rows][:, : len(shapes)] for key in ("state", "next_state"))
        parts.append(
            Dataset(
                state=state,
                action=columns["action"][rows],
                next_state=after,
                physics_next=state,
                episode=columns["episode"][rows],
                step=columns["step"][rows],
                friction=columns["friction"][rows],
                floor_next=np.full_like(state, np.nan),
                sha256="",
                bodies=Bodies.named(shapes, ["pushable"] * len(shapes)),
            )
        )
    digest = hashlib.sha256(columns["state"].tobytes() + columns["action"].tobytes())
    return MixedDataset(tuple(parts), digest.hexdigest(), ())


def learn(
    arguments: argparse.Namespace,
    split: MixedSplit,
    prior: PlanarPrior,
    friction: FrictionFilter | None,
) -> SainDynamics:
    """Return the trained network on its prior, with the regions of its predictions."""
    config = training_config(arguments, friction is not None)
    trainer = Trainer(split, prior, config, arguments.out, friction)
    trainer.run(
        lambda epoch, history: print(
            f"epoch {epoch}: {history.train[-1]:.3f} {history.validation[-1]:.3f}", flush=True
        )
    )
    infers = friction.config if friction else None
    name = PLANAR_LAB if arguments.identify else arguments.prior
    sain = SainDynamics(trainer.network, prior, name, friction=infers)
    return replace(sain, intervals=fit_intervals(sain, *split.validation.parts))


def training_config(arguments: argparse.Namespace, infers: bool) -> TrainingConfig:
    """Return the settings of a training; with `infers`, friction is inferred from history."""
    frame = arguments.frame or (WORLD_FRAME if arguments.world == "rough" else PUSH_FRAME)
    network = NetworkConfig(
        features=frame,
        members=arguments.members,
        bodies=ANY_SHAPE,
        hidden=arguments.hidden,
        message=arguments.hidden // 2,
        layers=arguments.layers,
    )
    smooth = arguments.world != "rough"
    loss = LossConfig(position_scale=0.0002, heading_scale=0.01) if smooth else LossConfig()
    return TrainingConfig(
        epochs=arguments.epochs,
        batch=arguments.batch,
        learning_rate=arguments.rate,
        network=network,
        loss=loss,
        weight_decay=arguments.decay,
        prior=arguments.prior,
        history=EPISODE if infers else NOTHING,
    )


if __name__ == "__main__":
    main()
