"""How cheap are the plans that each planner finds? ``python -m benchmarks.plan_costs``.

First plans in scenes of `anywhere`, one model, one thread: mean cost of the best sequence found,
the share of the scenes in which it is cheaper than the first planner's, rollouts and time.
"""

import time
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from benchmarks.planar_prior import on_threads
from sain_core.model import load_dynamics
from sain_core.seeding import generator
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.algorithms.config import PlannerConfig
from sain_mppi.algorithms.result import PlanResult
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

HEAD = (
    "| planner | K | mean cost | 95 % | cheaper than the first planner's | rollouts | ms |\n"
    "| --- | ---: | ---: | --- | ---: | ---: | ---: |"
)
RESAMPLES = 2000


@dataclass(frozen=True)
class Command:
    """What to compare."""

    algorithms: tuple[str, ...] = ("mppi_rounds", "icem", "gradient")
    """planners"""
    samples: tuple[int, ...] = (256, 1024, 4096)
    """K"""
    model: str = "sain"
    """name or path of what they roll out"""
    scenes: int = 60
    """scenes of `anywhere`"""
    seed: int = 0
    """of the first scene"""
    planner: Annotated[PlannerConfig, tyro.conf.arg(help="Settings of all of them.")] = field(
        default_factory=PlannerConfig
    )


def first_plans(planner: Planner, cases: list[ScenarioScene]) -> tuple[list[PlanResult], float]:
    """Return a plan for each scene, and the median time of one [s]."""
    plans, times = [], []
    for case in cases:
        planner.reset()
        begun = time.perf_counter()
        problem, random = Problem.of(case.disks, case.goal), generator(case.seed, "plan costs")
        plans.append(planner.plan(problem, random))
        times.append(time.perf_counter() - begun)
    return plans, float(np.median(times))


def main() -> None:
    """Print the table."""
    command = tyro.cli(Command, description=__doc__)
    console = Console(width=160, highlight=False)
    seeds = range(command.seed, command.seed + command.scenes)
    cases = [SCENARIOS["anywhere"].scene(seed) for seed in seeds]
    model = load_dynamics(command.model)
    console.print(HEAD, markup=False)
    for samples in command.samples:
        first: np.ndarray | None = None
        for algorithm in command.algorithms:
            config = replace(command.planner, algorithm=algorithm, samples=samples)
            with on_threads(1):
                plans, median = first_plans(Planner(model, config), cases)
            cells = [algorithm, str(samples), *results(plans, first), f"{1e3 * median:.0f}"]
            console.print(f"| {' | '.join(cells)} |", markup=False)
            first = np.array([plan.cost for plan in plans]) if first is None else first


def results(plans: list[PlanResult], first: np.ndarray | None) -> list[str]:
    """Return mean cost, its interval, how often it is below the first planner's, rollouts."""
    costs = np.array([plan.cost for plan in plans])
    random = generator(0, "bootstrap")
    means = costs[random.integers(len(costs), size=(RESAMPLES, len(costs)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    share = "" if first is None else f"{100 * np.mean(costs < first):.0f} %"
    rollouts = np.mean([plan.samples for plan in plans])
    return [f"{costs.mean():.2f}", f"{low:.2f} to {high:.2f}", share, f"{rollouts:.0f}"]


if __name__ == "__main__":
    main()
