"""How fast the planner plans.

1. Where the time of a plan with default settings goes, and the floor: the network's
   multiplications at the machine's measured peak.
2. Plans that keep a deadline.

Times are the shortest of some, taken in turns.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic, perf_counter
from typing import Annotated

import numba
import numpy as np
import torch
import tyro

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.timing import fastest
from sain_core.model import IdentityPrior, load_dynamics
from sain_core.push import LENGTH
from sain_core.randomness import generator
from sain_core.types import Scene
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_model.dynamics.sain import SainDynamics, weights_of
from sain_model.network.weights import DYNAMICS, RELATION
from sain_mppi.algorithms.sampling import PlanResult
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

DEADLINE = 0.05  # [s]
SIZE = 1024  # of the square matrices that show the machine's peak


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    parts: Annotated[tuple[str, ...], tyro.conf.Positional] = ("phases", "deadline")
    """What to measure."""
    model: str = "sain"
    """Name or checkpoint; a network on the planar prior."""
    repeats: int = 15
    """Plans of each kind, of which the fastest counts."""
    plans: int = 300
    """Plans that should keep the deadline."""


def problem(seed: int = 0) -> ScenarioScene:
    """Return a scene to plan from."""
    return SCENARIOS["anywhere"].scene(seed)


def plan_again(planner: Planner, case: ScenarioScene, seed: int = 0) -> PlanResult:
    """Plan a scene as the first of an episode."""
    return planner.plan(Problem.of(case.disks, case.goal), generator(seed, "benchmark"))


def phases(sain: SainDynamics, options: Options) -> list[Figure]:
    """Measure where the time of a plan with default settings goes, and the floor."""
    planner, case = Planner(sain), problem()
    results = [plan_again(planner, case) for _ in range(options.repeats)]
    best = min(results, key=lambda result: result.times.total)
    threads = numba.get_num_threads()
    product = fastest({"peak": peak(threads)}, options.repeats)["peak"].wall
    most = 2.0 * SIZE**3 / product
    work = multiplications(sain, len(case.disks)) * moving_pushes(planner, case)
    floor = work / most
    config = planner.config
    title = f"default plan ({best.samples} sequences, H = {config.horizon}, {threads} cores)"
    times = best.times
    return [
        Figure(title, 1e3 * times.total, "ms"),
        Figure("... in the model", 1e3 * times.rollout, "ms"),
        Figure("... costs", 1e3 * times.cost, "ms"),
        Figure("... drawing, masking, keeping", 1e3 * times.sampling, "ms"),
        Figure("floor: the network's products at the measured peak", 1e3 * floor, "ms"),
        Figure("plan / floor", times.total / floor, "times"),
    ]


def peak(threads: int) -> Callable[[], object]:
    """Return a multiplication of large matrices in single precision, on so many threads."""
    left, right = torch.rand(SIZE, SIZE), torch.rand(SIZE, SIZE)

    def multiply() -> None:
        torch.set_num_threads(threads)
        torch.mm(left, right)
        torch.set_num_threads(1)

    return multiply


def multiplications(sain: SainDynamics, disks: int) -> float:
    """Return the floating-point operations of the network's products for one push."""
    tensors = weights_of(sain).tensors

    def of(part: str) -> float:
        return 2.0 * sum(
            tensors[name].size for name in tensors if name.startswith(part) and "weight" in name
        )

    return disks * (disks - 1) * of(RELATION) + disks * of(DYNAMICS)


def moving_pushes(planner: Planner, case: ScenarioScene) -> int:
    """Return how many pushes of a plan move anything: rests cost nothing."""

    class Counting(IdentityPrior):
        """Passes rollouts on and counts."""

        pushes = 0

        def rollout(self, scene: Scene, pushes: np.ndarray) -> np.ndarray:
            Counting.pushes += int((pushes[..., LENGTH] > 0.0).sum())
            return model.rollout(scene, pushes)

    model = planner.model
    plan_again(replace(planner, model=Counting()), case)
    return Counting.pushes


def deadlines(sain: SainDynamics, options: Options) -> list[Figure]:
    """Count plans that keep a deadline, each from another scene."""
    planner = Planner(sain)
    cases = [problem(seed) for seed in range(20)]
    plan_again(planner, cases[0])
    late, samples = [], []
    for number in range(options.plans):
        case = cases[number % len(cases)]
        begun = perf_counter()
        result = planner.plan(
            Problem.of(case.disks, case.goal),
            generator(number, "deadline"),
            deadline=monotonic() + DEADLINE,
        )
        late.append(perf_counter() - begun > DEADLINE)
        samples.append(result.samples)
    kept = 100.0 * (1.0 - float(np.mean(late)))
    return [
        Figure(
            f"plans that kept {1e3 * DEADLINE:.0f} ms, of {len(late)}", kept, "%", at_least=99.0
        ),
        Figure("... sequences that they rolled out, median", float(np.median(samples)), ""),
    ]


def main() -> None:
    """Measure how fast the planner plans."""
    options = read_options(Options, __doc__)
    torch.set_num_threads(1)
    sain = load_dynamics(options.model)
    if not isinstance(sain, SainDynamics):
        sys.exit(f"{options.model} has no network")
    parts: dict[str, Callable[[], list[Figure]]] = {
        "phases": lambda: phases(sain, options),
        "deadline": lambda: deadlines(sain, options),
    }
    figures = [figure for name in options.parts for figure in parts[name]()]
    report("The planner", figures, options.out)


if __name__ == "__main__":
    main()
