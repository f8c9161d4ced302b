"""SAIN on the whole library of shapes: errors of prior and network, on shapes seen and unseen.

    nice ./env python -m benchmarks.shapes_collect data/shapes --episodes 5000
    nice ./env python -m benchmarks.shapes_learning data/shapes --world rough --out runs/shapes

Friction is inferred from the episode's earlier pushes, for the baseline and, without
`--no-history`, for SAIN. `--baseline` learns nothing.
"""

import argparse
import hashlib
import json
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from sain_core.dataset import draw_parts
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_model.compute.threads import settle_threads
from sain_model.data.dataset import Dataset
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.data.shaped_physics import filter_for
from sain_model.dynamics.checkpoint import ModelCard, save_checkpoint
from sain_model.dynamics.priors import prior_settings
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import PLANAR, PLANAR_LAB, LossConfig
from sain_model.evaluation.history_errors import earlier_friction, predict_with_history
from sain_model.network.settings import ANY_SHAPE, PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior
from sain_model.training.interval_fit import fit_intervals
from sain_model.training.lab_fit import fit_lab
from sain_model.training.push_training import Trainer
from sain_model.training.settings import EPISODE, NOTHING, TrainingConfig

IDENTIFIED_BY = 300  # combinations of shapes with an earlier episode than this fit the prior
MOVED = 0.002  # [m]; bodies that moved less are left out
Rows = dict[str, np.ndarray]


def main() -> None:
    """Learn and measure; see the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True)
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
    usual = prior = PlanarPrior()
    if arguments.identify:
        prior = fit_lab([part for part in split.train.parts if part.episode.min() < IDENTIFIED_BY])
        print(prior.centre, prior.config.friction, prior.config.disk_friction, flush=True)
    baseline, friction = make_filter(usual, split.train), make_filter(prior, split.train)
    assert friction is not None
    assert baseline is not None
    print(friction.config, *(len(part) for part in vars(split).values()), len(unseen), flush=True)
    tests = {"seen": split.test, "unseen": unseen}
    sain = None
    if not arguments.baseline:
        sain = learn(arguments, split, prior, None if arguments.no_history else friction)
        name = PLANAR_LAB if arguments.identify else PLANAR
        card = ModelCard(
            name,
            prior_settings(prior),
            {},
            friction=asdict(sain.friction) if sain.friction else None,
            intervals=asdict(sain.intervals) if sain.intervals else None,
            kind=sain.kind,
            command=f"benchmarks.shapes_learning {vars(arguments)}",
        )
        save_checkpoint(arguments.out / "sain.safetensors", sain.network, card)
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
    config = TrainingConfig(
        epochs=arguments.epochs,
        batch=arguments.batch,
        learning_rate=arguments.rate,
        network=network,
        loss=loss,
        weight_decay=arguments.decay,
        history=EPISODE if friction else NOTHING,
    )
    trainer = Trainer(split, prior, config, arguments.out, friction)
    trainer.run(
        lambda epoch, history: print(
            f"epoch {epoch}: {history.train[-1]:.3f} {history.validation[-1]:.3f}", flush=True
        )
    )
    infers = friction.config if friction else None
    sain = SainDynamics(trainer.network, prior, "planar", friction=infers)
    return replace(sain, intervals=fit_intervals(sain, *split.validation.parts))


def measure(
    physics: FrictionFilter | PlanarPrior, sain: SainDynamics | None, data: MixedDataset
) -> Rows:
    """Return one row for each body of each push, of physics with a filter of friction or alone."""
    pieces: list[Rows] = []
    for part in data.parts:
        assert part.bodies is not None
        count = part.disks
        if isinstance(physics, PlanarPrior):
            after = physics.with_bodies(part.bodies).step(part.state, part.action)
        else:
            told = filter_for(physics, part.bodies)
            known = earlier_friction(told, part)
            after = told.physics.step(part.state, part.action, known.mean)
        moved = np.linalg.norm((part.next_state - part.state)[..., POSITION], axis=-1)
        names = np.array([shape.name for shape in part.bodies.shapes])
        columns = {
            "shape": np.broadcast_to(names, (len(part), count)),
            "pushed": pushed_bodies(part.action)[:, None] == np.arange(count),
            "alone": np.full((len(part), count), count == 1),
            "moved": moved,
            **errors("prior", after, part.next_state),
        }
        if sain is not None:
            said = predict_with_history(sain, part)
            assert said.radius is not None
            columns |= errors("sain", said.mean, part.next_state)
            columns |= {"inside": columns["sain_mm"] <= 1e3 * said.radius, "radius": said.radius}
        pieces.append({name: values.reshape(-1) for name, values in columns.items()})
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def errors(name: str, predicted: np.ndarray, truth: np.ndarray) -> Rows:
    """Return errors of position [mm] and heading [deg], (M, N)."""
    off = np.linalg.norm((predicted - truth)[..., POSITION], axis=-1)
    turned = np.abs(wrap_angle(predicted[..., THETA] - truth[..., THETA]))
    return {f"{name}_mm": 1e3 * off, f"{name}_deg": np.degrees(turned)}


def table(rows: Rows) -> str:
    """Return a table per shape, of the pushed bodies, and of all bodies that moved."""
    lines = []
    learned = "sain_mm" in rows
    head = "| bodies | pushes | prior mm: median, mean, p95 | prior deg |"
    if learned:
        head += " SAIN mm | SAIN deg | ratio mm | ratio deg | coverage |"
    lines += [head, "| --- |" + " ---: |" * (head.count("|") - 2)]
    pushed = rows["pushed"]
    groups = {f"{name}": pushed & (rows["shape"] == name) for name in sorted(set(rows["shape"]))}
    groups |= {
        "**pushed, alone**": pushed & rows["alone"],
        "**pushed, of two**": pushed & ~rows["alone"],
        "**pushed**": pushed,
        "**not pushed, moved**": ~pushed & (rows["moved"] >= MOVED),
        "**all that moved**": rows["moved"] >= MOVED,
        "**all**": rows["moved"] >= 0.0,
    }
    for name, chosen in groups.items():
        if not chosen.any():
            continue
        cells = [name, str(int(chosen.sum()))]
        for model in ("prior", "sain") if learned else ("prior",):
            cells += [three(rows[f"{model}_mm"][chosen]), three(rows[f"{model}_deg"][chosen])]
        if learned:
            for unit in ("mm", "deg"):
                ratio = rows[f"sain_{unit}"][chosen].mean() / rows[f"prior_{unit}"][chosen].mean()
                cells.append(f"{ratio:.2f}")
            cells.append(f"{100 * rows['inside'][chosen].mean():.0f} %")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def three(values: np.ndarray) -> str:
    """Return median, mean and 95th percentile."""
    return f"{np.median(values):.2f}, {values.mean():.2f}, {np.percentile(values, 95):.2f}"


def summary(rows: Rows) -> dict[str, Any]:
    """Return the means over the pushed bodies."""
    pushed = rows["pushed"]
    return {
        name: float(values[pushed].mean())
        for name, values in rows.items()
        if name.endswith(("_mm", "_deg")) or name == "inside"
    }


if __name__ == "__main__":
    main()
