"""How fast the planner plans.

1. Plan time against K and H, with a picture.
2. Where the time of a plan with default settings goes, and the floor: the network's
   multiplications at the machine's measured peak.
3. Plans that keep a deadline.

Times are the shortest of some, taken in turns.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic, perf_counter
from typing import Annotated

import numba
import numpy as np
import torch
import tyro
from matplotlib.figure import Figure as Picture

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.speed.inference import SIZE, multiplications, peak
from benchmarks.timing import fastest
from sain_core.model import IdentityPrior, load_dynamics
from sain_core.push import LENGTH
from sain_core.randomness import generator
from sain_core.types import Scene
from sain_core.view.figures import TEXT, new_figure, style_axes, write_png
from sain_core.view.palette import PALETTE
from sain_eval.scenes.scenarios import SCENARIOS, ScenarioScene
from sain_model.dynamics.sain import SainDynamics
from sain_mppi.algorithms.sampling import PlanResult
from sain_mppi.config import MPPI, PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

SAMPLES, HORIZON = 1024, 15
COUNTS = (64, 256, 1024, 4096, 16384)
HORIZONS = (1, 2, 4, 8, 15, 30)
DEADLINE = 0.05  # [s]


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    parts: Annotated[tuple[str, ...], tyro.conf.Positional] = ("scaling", "phases", "deadline")
    """What to measure."""
    model: str = "sain"
    """Name or checkpoint; a network on the planar prior."""
    repeats: int = 15
    """Plans of each kind, of which the fastest counts."""
    plans: int = 300
    """Plans that should keep the deadline."""
    picture: Path | None = None
    """Draw plan time against K and H into this file."""


def problem(seed: int = 0) -> ScenarioScene:
    """Return a scene to plan from."""
    return SCENARIOS["anywhere"].scene(seed)


def plan_again(planner: Planner, case: ScenarioScene, seed: int = 0) -> PlanResult:
    """Plan a scene as the first of an episode."""
    return planner.plan(Problem.of(case.disks, case.goal), generator(seed, "benchmark"))


def scaling(sain: SainDynamics, options: Options) -> list[Figure]:
    """Measure plan time against K and H."""
    usual = replace(PlannerConfig(), algorithm=MPPI, stop_share=0.0)
    by_samples = plan_times(
        sain, {k: replace(usual, samples=k, horizon=HORIZON) for k in COUNTS}, options
    )
    by_horizon = plan_times(
        sain, {h: replace(usual, samples=SAMPLES, horizon=h) for h in HORIZONS}, options
    )
    if options.picture is not None:
        write_png(draw(by_samples, by_horizon), options.picture)
    each = {count: 1e6 * seconds / count for count, seconds in by_samples.items()}
    figures = [
        Figure(f"K = {count}, H = {HORIZON}: a sequence", value, "us")
        for count, value in each.items()
    ]
    figures.append(
        Figure("the dearest of K >= 256 / the cheapest", spread(each, 256), "times", at_most=2.0)
    )
    pushes = {h: 1e6 * seconds / (SAMPLES * h) for h, seconds in by_horizon.items()}
    figures += [
        Figure(f"K = {SAMPLES}, H = {h}: a push", value, "us") for h, value in pushes.items()
    ]
    figures.append(
        Figure("the dearest of H >= 4 / the cheapest", spread(pushes, 4), "times", at_most=2.0)
    )
    return figures


def spread(values: dict[int, float], least: int) -> float:
    """Return the largest value over the smallest, from some size on."""
    chosen = [value for size, value in values.items() if size >= least]
    return max(chosen) / min(chosen)


def plan_times(
    sain: SainDynamics, configs: dict[int, PlannerConfig], options: Options
) -> dict[int, float]:
    """Return the shortest time [s] of a plan with each of these settings."""
    case = problem()
    works: dict[str, Callable[[], object]] = {
        str(size): lambda planner=Planner(sain, config): plan_again(planner, case)  # type: ignore[misc]
        for size, config in configs.items()
    }
    repeats = max(options.repeats // 3, 1)
    return {int(size): times.wall for size, times in fastest(works, repeats).items()}


def draw(by_samples: dict[int, float], by_horizon: dict[int, float]) -> Picture:
    """Draw plan time against K and against H, each beside a straight line."""
    picture = new_figure(6.6, 3.6)
    left, right = picture.subplots(1, 2)
    panels = (
        (left, by_samples, f"K, sequences (H = {HORIZON})"),
        (right, by_horizon, f"H, pushes in a sequence (K = {SAMPLES})"),
    )
    for axes, times, label in panels:
        sizes, seconds = np.array(list(times)), np.array(list(times.values()))
        line = seconds[-1] / sizes[-1] * sizes
        axes.loglog(sizes, 1e3 * line, color=PALETTE.physics, linewidth=1, label="proportional")
        axes.loglog(sizes, 1e3 * seconds, "o-", color=PALETTE.mid, label="measured")
        style_axes(axes, grid="both", xlabel=label, ylabel="time of a plan [ms]")
        axes.set_xticks(sizes, [str(size) for size in sizes])
        axes.minorticks_off()
        axes.legend(frameon=False)
    title = f"One round of MPPI over SAIN, {numba.get_num_threads()} cores"
    picture.suptitle(title, fontsize=TEXT + 1.5)
    return picture


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
        "scaling": lambda: scaling(sain, options),
        "phases": lambda: phases(sain, options),
        "deadline": lambda: deadlines(sain, options),
    }
    figures = [figure for name in options.parts for figure in parts[name]()]
    figures.append(Figure("load average meanwhile", os.getloadavg()[0], ""))
    report("The planner", figures, options.out)


if __name__ == "__main__":
    main()
