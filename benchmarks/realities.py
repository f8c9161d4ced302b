r"""The shipped model against plain physics in worlds that it was and was not trained for.

    collect() { nice ./env ros2 run sain_sim collect --out data/identify/"$@"; }
    shapes="--bodies 1-2 --shapes cube,t,l,triangle,bar,hexagon,plus,ellipse,half_ring"
    collect mujoco_disks --engine mujoco --episodes 300 --seed 201
    collect bullet_disks --episodes 200 --seed 202
    collect rough_disks --world rough --episodes 150 --seed 205
    collect measured_disks --world measured --engine mujoco --episodes 150 --seed 210
    collect mujoco_shapes --engine mujoco --episodes 120 --seed 203 $shapes
    collect bullet_shapes --episodes 100 --seed 204 $shapes
    collect rough_shapes --world rough --episodes 100 --seed 208 $shapes
    collect mujoco_cubes --engine mujoco --episodes 80 --seed 206 --target cube
    collect bullet_cubes --episodes 80 --seed 207 --target cube
    collect rough_cubes --world rough --episodes 80 --seed 209 --target cube
    nice ./env python -m benchmarks.realities compare data/identify/*
    nice ./env python -m benchmarks.realities learn data/identify/mujoco_disks

`compare` prints errors of places with the earlier pushes of each episode, and ratios with 95 %
intervals over episodes. `learn` identifies on the first episodes and takes errors on the second
half. Errors are those of the target, or with ``shapes`` of the pushed body.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from sain_core.bootstrap import bootstrap_ratio
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, TARGET
from sain_core.seeding import generator
from sain_model.data.dataset import Dataset, Part
from sain_model.data.recordings import first_pushes, load_recording
from sain_model.dynamics.identify import identify
from sain_model.dynamics.load import load_shipped
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.predictors import (
    MEASURED,
    PLANAR_HISTORY,
    earlier_pushes,
    predict_all,
    step_with_history,
)
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.kinds import Belief, friction_belief, friction_kind
from sain_model.inference.laboratory import count_episodes
from sain_model.physics.planar import PlanarPrior

FEW = 4  # earlier pushes from which on "after 4" counts
PLANAR, FRICTION, SHIPPED, TRUE, EPISODE, COUNT = (
    "planar", "axes, friction alone", "shipped", "planar, true parameters", "episode", "count",
)  # fmt: skip
HEAD = """\
| data | pushes | planar | friction | shipped | to planar | to friction alone | to true, 4+ |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""
Rows = dict[str, np.ndarray]
PHYSICS = SainDynamics(friction_belief(PlanarPrior()))


def main() -> None:
    """Compare or learn; see the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=("compare", "learn"))
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--sizes", type=int, nargs="+", default=[50, 100, 200, 500])
    arguments = parser.parse_args()
    model = load_shipped()
    if arguments.task == "compare":
        print(HEAD)
    for folder in arguments.folders:
        if arguments.task == "compare":
            print(comparison(folder, rows_of(folder, model)), flush=True)
        else:
            learn(folder, model, arguments.sizes)
    sys.stdout.flush()


def datasets(parts: list[ObservedPushes], truths: dict[bytes, float]) -> list[Part]:
    """Return recorded pushes as data sets, with their true friction where it is known."""
    found = []
    for part in parts:
        keys = [state.tobytes() for state in part.state]
        friction = np.array([truths.get(key, np.nan) for key in keys])
        nothing = np.full_like(part.state, np.nan)
        step = np.arange(len(part))
        found.append(
            Part(
                part.state,
                part.action,
                part.next_state,
                nothing,
                part.episode,
                step,
                friction,
                nothing,
                part.bodies,
            )
        )
    return found


def true_frictions(folder: Path) -> dict[bytes, float]:
    """Return the friction of each push of a folder, by the bytes of its scene."""
    found: dict[bytes, float] = {}
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as shard:
            states = shard["state"].reshape(len(shard["friction"]), -1)
            found |= {
                row.tobytes(): float(value)
                for row, value in zip(states, shard["friction"], strict=True)
            }
    return found


def rows_of(folder: Path, model: SainDynamics) -> Rows:
    """Return errors [mm] of each push of a folder."""
    pieces: list[Rows] = []
    before = without_belief(model)
    for data in datasets(load_recording(folder), true_frictions(folder)):
        plain = PlanarPrior(bodies=data.bodies)
        known = np.where(np.isfinite(data.friction), data.friction, 0.12)
        predicted = {
            PLANAR: step_with_history(PHYSICS, data),
            TRUE: plain.step(data.state, data.action, {"friction": known}),
            FRICTION: step_with_history(before, data),
            SHIPPED: step_with_history(model, data),
        }
        body = body_of(folder, data)
        rows = {name: errors(data, after, body) for name, after in predicted.items()}
        pieces.append(rows | {EPISODE: data.episode, COUNT: earlier_pushes(data)})
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def without_belief(model: SainDynamics) -> SainDynamics:
    """Return a model that infers friction alone, as before decision 35."""
    return replace(model, belief=Belief((friction_kind(model.belief.trained.prior),)))


def body_of(folder: Path, data: Part) -> np.ndarray:
    """Return whose error counts: the pushed body of many shapes, else the target."""
    many = "shapes" in folder.name
    return pushed_bodies(data.action) if many else np.full(len(data), TARGET)


def errors(data: Part, predicted: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Return errors of places (M,) [mm]."""
    off = (predicted - data.next_state)[np.arange(len(data)), body]
    return np.asarray(1e3 * np.linalg.norm(off[:, POSITION], axis=-1))


def comparison(folder: Path, rows: Rows) -> str:
    """Return a line of the table."""
    few = rows[COUNT] >= FEW
    means = [f"{rows[name].mean():.2f}" for name in (PLANAR, FRICTION, SHIPPED)]
    ratios = [
        ratio(rows, SHIPPED, PLANAR, few | True),
        ratio(rows, SHIPPED, FRICTION, few | True),
        ratio(rows, SHIPPED, TRUE, few),
    ]
    cells = [folder.name, str(len(few)), *means, *ratios]
    return "| " + " | ".join(cells) + " |"


def ratio(rows: Rows, first: str, second: str, chosen: np.ndarray) -> str:
    """Return the ratio of two mean errors with its bootstrap interval over episodes."""
    above, below, episodes = (rows[name][chosen] for name in (first, second, EPISODE))
    interval = bootstrap_ratio(above, below, generator(0, "realities"), episodes)
    return "{:.3f} [{:.3f}, {:.3f}]".format(*interval)


def learn(folder: Path, model: SainDynamics, sizes: list[int]) -> None:
    """Print errors on the second half of the episodes, identified on the first ones."""
    parts = load_recording(folder)
    half = count_episodes(parts) // 2
    held_out = [part.select(part.episode >= half) for part in parts]
    tests = datasets([part for part in held_out if len(part)], {})
    every = predict_all(Dataset(tuple(tests)), {})
    for name in (MEASURED, PLANAR_HISTORY):
        print(name, mean_error(folder, [(one.part, one.by_name[name][:, 0]) for one in every]))
    for name, one in (("friction alone", without_belief(model)), ("shipped", model)):
        print(name, mean_error(folder, [(d, step_with_history(one, d)) for d in tests]))
    for size in sizes:
        some = first_pushes(parts, size)
        start = time.perf_counter()
        belief = identify(model, {str(folder): some})
        taken = time.perf_counter() - start
        one = model.believing(belief)
        error = mean_error(folder, [(d, step_with_history(one, d)) for d in tests])
        count = sum(map(len, some))
        print(f"{count} pushes, {taken:.1f} s, {belief.likeliest.name}: {error}", flush=True)


def mean_error(folder: Path, predicted: list[tuple[Part, np.ndarray]]) -> str:
    """Return the mean error [mm] of predictions, and from the fifth push of an episode on."""
    off = [errors(data, after, body_of(folder, data)) for data, after in predicted]
    few = [earlier_pushes(data) >= FEW for data, _ in predicted]
    every, later = np.concatenate(off), np.concatenate(off)[np.concatenate(few)]
    return f"{every.mean():.2f} mm; {later.mean():.2f} mm after {FEW} pushes"


if __name__ == "__main__":
    main()
