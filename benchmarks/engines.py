"""The same randomised pushes in each physics engine: ``./env python -m benchmarks.engines``.

Shows what a push costs in CPU time of one core, how true the tool runs, how well a push repeats
from the scene that was observed, and how far the outcomes of two engines are apart.
"""

import time
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tyro

from benchmarks.report import Figure, report
from benchmarks.sim_push import Case, cases
from benchmarks.sim_push import Options as PushOptions
from sain_core.errors import UnreachableError
from sain_core.scene import MID, POSITION, TARGET, unit
from sain_core.types import Scene
from sain_sim.world.engines import ENGINES
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.stroke import Stroke
from sain_sim.world.workcell import Sample, Watch
from sain_sim.world.world import World

FURTHER = 0.05  # [m]
BODIES = {"mid disk": MID, "target": TARGET}


@dataclass(frozen=True)
class Options:
    """How much to measure."""

    pushes: int = 200
    """pushes in each engine"""
    seed: int = 0
    """of the pushes"""
    out: Path | None = None
    """write the figures to this JSON file"""


class Pushed(NamedTuple):
    """What an engine did."""

    ends: Scene  # (pushes, N, 8)
    cost: float  # [ms] of CPU time a push, the world's set-up included
    off: np.ndarray  # [mm], the tool from where it was commanded to be, each step


def push_all(engine: str, drawn: list[Case]) -> Pushed:
    """Push each case, once with the clock running and once with a look at the tool."""
    ends: list[Scene] = []
    off: list[float] = []

    def note(sample: Sample) -> None:
        if sample.phase == "push":
            off.append(1e3 * float(np.linalg.norm(sample.tool - sample.commanded_tool)))

    with World(nominal_parameters(), engine=engine) as world:
        begun = time.process_time()
        for parameters, start, push in drawn:
            world.load(start, parameters)
            ends.append(world.carry_out(world.check(push), guarded=False).after)
        cost = 1e3 * (time.process_time() - begun) / len(drawn)
        for parameters, start, push in drawn[: len(drawn) // 4]:
            world.load(start, parameters)
            world.carry_out(world.check(push), Watch(note, 1), guarded=False)
    return Pushed(np.array(ends), cost, np.array(off))


def repeated(engine: str, drawn: list[Case]) -> np.ndarray:
    """Return how far targets end (P,) [mm] from where they did, from the scene as observed.

    A second push goes 50 mm further, from the state that the first one led to and from its scene.
    """
    apart = []
    with World(nominal_parameters(), engine=engine) as world:
        for parameters, start, push in drawn[: len(drawn) // 4]:
            world.load(start, parameters)
            stroke = world.check(push)
            end = stroke.end + FURTHER * unit(np.asarray(stroke.heading))
            further = Stroke(stroke.start, end, stroke.heading)
            try:
                seen = world.carry_out(stroke, guarded=False).after
                ends = [world.carry_out(further, guarded=False).after]
            except UnreachableError:
                continue
            world.load(seen, parameters)
            ends.append(world.carry_out(further, guarded=False).after)
            apart.append(1e3 * np.linalg.norm((ends[1] - ends[0])[TARGET, POSITION]))
    return np.array(apart)


def main() -> None:
    """Measure the physics engines on the same pushes."""
    options = tyro.cli(Options, description=main.__doc__)
    drawn = cases(PushOptions(pushes=options.pushes, seed=options.seed))
    found = {engine: push_all(engine, drawn) for engine in ENGINES}
    figures = []
    for engine, pushed in found.items():
        again = repeated(engine, drawn)
        figures += [
            Figure(f"{engine}: a push", pushed.cost, "ms"),
            Figure(f"{engine}: pushes", 1e3 / pushed.cost, "/s"),
            Figure(f"{engine}: tool off its place, p50", float(np.median(pushed.off)), "mm"),
            Figure(f"{engine}: the same, p99", float(np.percentile(pushed.off, 99)), "mm"),
            Figure(f"{engine}: target, repeated from its scene, mean", again.mean(), "mm"),
            Figure(f"{engine}: the same, p95", float(np.percentile(again, 95)), "mm"),
        ]
    for first, second in combinations(ENGINES, 2):
        ways = (found[second].ends - found[first].ends)[..., POSITION]
        for name, body in BODIES.items():
            apart = 1e3 * np.linalg.norm(ways[:, body], axis=-1)
            figures.append(Figure(f"{name}: {second} from {first}, mean", apart.mean(), "mm"))
            figures.append(Figure("the same, p95", float(np.percentile(apart, 95)), "mm"))
    report("Physics engines", figures, options.out)


if __name__ == "__main__":
    main()
