"""What taught pushes are worth: errors on ordinary work after so many of them, and of random ones.

    ./env python -m benchmarks.results.learning --out results/learning --lab mujoco    # the work
    ./env python -m benchmarks.results.teaching --out results/learning --lab mujoco --seeds 3

The pushes that are predicted are those of the work, with the earlier ones of their episode. Only
the physics is learned: 25 pushes are too few for a network.
"""

import argparse
from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.report import Figure, report
from benchmarks.results.learning import LABS, pushes_of
from sain_core.feasibility import Feasibility
from sain_core.output import write_json
from sain_core.randomness import bootstrap_ratio, generator
from sain_core.transitions import PushHistory
from sain_eval.loop.closed_loop import RandomDecider
from sain_lab.keeping.results import Result
from sain_lab.learner import prediction_error
from sain_lab.physics import Believer
from sain_lab.settings import TeachOptions
from sain_lab.teaching.information import Teacher, Work
from sain_lab.teaching.lesson_plan import Room, Rooms, Teaching, rooms_of, work_of
from sain_model.compute.kernel_store import compile_kernels
from sain_model.dynamics.load import load_shipped
from sain_model.dynamics.sain import SainDynamics
from sain_mppi.agent.planning import Decider

TAUGHT: Final = 25
RANDOM: Final = (25, 75)
WORK: Final = 150  # pushes that are predicted
FAR: Final = 50_000  # between the seeds of runs


def learned(settings: TeachOptions, work: Work, decider: Callable[..., Decider]) -> list[Result]:
    """Return the pushes of a decider, from which the physics is learned as they come."""
    believer, taken = Believer(load_shipped()), []

    def take(result: Result) -> None:
        believer.add(result)
        taken.append(result)

    def model() -> SainDynamics:
        return believer.model

    def between(rooms: Rooms) -> Iterable[Room]:
        for room in rooms:
            believer.update()
            yield room

    Teaching(model, take, work, decider).visit(between(rooms_of(settings)), settings)
    return taken


def errors_after(results: Iterable[Result], work: list[Result]) -> np.ndarray:
    """Return errors [mm] of pushes of work, predicted with what these results say."""
    believer = Believer(load_shipped())
    for one in results:
        believer.add(one)
    believer.update()
    errors, episode, history = [], "", PushHistory.empty()
    for one in work:
        if one.episode != episode:
            episode, history = one.episode, PushHistory.empty(len(one.before))
        model = believer.model.with_bodies(one.own_bodies).condition(history)
        errors.append(prediction_error(model.step(one.before[None], one.push[None])[0], one)[0])
        history = history.then(one.before, one.push, one.after)
    return np.array(errors)


def main() -> None:
    """Teach, push at random, and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--lab", choices=tuple(LABS), required=True)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    compile_kernels()
    work = list(islice(pushes_of(options.out / options.lab), WORK))
    episodes = np.unique([one.episode for one in work], return_inverse=True)[1]
    found: dict[str, list[np.ndarray]] = {}
    for seed in range(options.seeds):
        for name, count, decider in (
            ("taught", TAUGHT, Teacher),
            ("random", max(RANDOM), lambda *_: RandomDecider(Feasibility())),
        ):
            settings = _settings(options.lab, (2 * seed + (name == "taught") + 1) * FAR, count)
            pushes = learned(settings, work_of(settings, load_shipped()), decider)
            for some in (TAUGHT,) if name == "taught" else RANDOM:
                errors = errors_after(pushes[:some], work)
                found.setdefault(f"{name} {some}", []).append(errors)
                print(f"{options.lab} {seed}: {name} {some}: {errors.mean():.3f} mm", flush=True)
    means = {name: np.mean(some, axis=0) for name, some in found.items()}
    figures = [Figure(f"{options.lab}: {name}", some.mean(), "mm") for name, some in means.items()]
    ratios = {}
    for count in RANDOM:
        pair = means[f"taught {TAUGHT}"], means[f"random {count}"]
        ratios[count] = bootstrap_ratio(*pair, generator(0, "teaching"), episodes)
        most = 1.0 if count == max(RANDOM) else None
        name = f"... taught {TAUGHT} / random {count}"
        figures.append(Figure(name, ratios[count].estimate, "", at_most=most))
    report("Teaching", figures, options.out / f"teaching_{options.lab}.json")
    write_json(options.out / f"teaching_{options.lab}_intervals.json", ratios)


def _settings(lab: str, seed: int, pushes: int) -> TeachOptions:
    truth = LABS[lab]
    return TeachOptions(
        pushes=pushes, seed=seed, world=truth.world, engine=truth.engine, lab=truth.lab
    )


if __name__ == "__main__":
    main()
