"""Which slopes of the planner's cost hold up? ``python -m benchmarks.gradients --learned PATH``.

For the best of random and informed sequences in scenes of `anywhere`: how often a small step along
minus the slope lowers the cost, and by how much of what the slope promises. Slopes are finite
differences of several sizes through the network on the compiled prior, the prior alone, the
network alone; for the last also automatic differentiation, and how far the two agree.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
import tyro
from numpy import ndarray
from rich.console import Console

from benchmarks.differentiable import DifferentiableRollout
from benchmarks.planar_prior import on_threads
from benchmarks.timing import fastest
from sain_core.dynamics import RolloutModel, as_rollout
from sain_core.feasibility import Feasibility
from sain_core.plugins import load_dynamics
from sain_core.push import LENGTH
from sain_core.scene import POSE, POSITION, TARGET
from sain_core.seeding import generator
from sain_core.types import PushSequences, Scalars
from sain_eval.scenes.scenarios import SCENARIOS, ScenarioScene
from sain_model.dynamics.load import load_sain
from sain_mppi.algorithms.gradient import descend, take_slopes
from sain_mppi.search.config import PlannerConfig
from sain_mppi.search.cost import cost_terms, make_rollout, total_cost
from sain_mppi.search.goal import Goal
from sain_mppi.search.objective import TargetObjective
from sain_mppi.search.proposals import draw_permitted, propose
from sain_mppi.search.sampling import inside_limits
from sain_mppi.search.search import Search

CONFIG = PlannerConfig()
UNIT = CONFIG.noise.deviations(0)
HEAD = (
    "| slope | small step lowers | of what it promises | line search lowers | by |"
    " cosine to autograd | ms for 8 |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
)
TINY_STEP = 1e-6  # [m, rad], of the differences of the cost alone, which is cheap and exact


@dataclass(frozen=True)
class Command:
    """What to compare."""

    learned: Path
    """checkpoint of a network on the identity prior"""
    sain: str = "sain"
    """name or path of a network on the planar prior"""
    scenes: int = 30
    """scenes of `anywhere`, from seed 1000"""
    starts: int = 8
    """sequences in each, the best of 512"""
    descended: int = 0
    """steps that the planner's descent has taken from there before slopes are looked at"""
    differences: tuple[float, ...] = (0.2, 0.05, 0.02, 0.005, 0.001)
    """nudges, in standard deviations of the noise"""
    step: float = 0.01
    """the small step, of the number that moves most, in the same unit"""


@dataclass(frozen=True)
class Place:
    """Sequences in one scene, and what they cost."""

    search: Search
    goal: Goal
    sequences: PushSequences
    costs: Scalars


Slopes = Callable[[Place], PushSequences]


def places(model: RolloutModel, command: Command) -> list[Place]:
    """Return the best sequences of each scene."""
    found = []
    for seed in range(1000, 1000 + command.scenes):
        case: ScenarioScene = SCENARIOS["anywhere"].scene(seed)
        config = replace(CONFIG, gradient=replace(CONFIG.gradient, steps=command.descended))
        assert isinstance(case.goal, np.ndarray)  # a place, as in all scenes of this scenario
        objective = TargetObjective(case.goal, config.weights, Feasibility())
        search = Search(model, config, Feasibility(), case.disks, objective)
        random = generator(seed, "slopes")

        draw = partial(propose, search, None, 0, random)
        drawn = draw_permitted(search, draw, 512, random)
        costs = search.evaluate(drawn)
        best = np.argsort(costs, kind="stable")[: command.starts]
        found.append(Place(search, case.goal, *descend(search, drawn[best], costs[best])))
    return found


def distances(where: list[Place]) -> Scalars:
    """Return how far from the goal [m] the sequences leave the target."""
    left = []
    for place in where:
        predicted = place.search.model.rollout(place.search.scene, place.sequences)
        off = predicted[:, -1, TARGET, POSITION] - place.goal
        left.append(np.linalg.norm(off, axis=1))
    return np.concatenate(left)


def by_differences(size: float) -> Slopes:
    """Return what takes slopes as the planner does."""
    return lambda place: UNIT * take_slopes(place.search, place.sequences, place.costs, size * UNIT)


def by_autograd(rollout: DifferentiableRollout, cost: bool = True) -> Slopes:
    """Return what takes slopes through the network by PyTorch, those of the cost by themselves.

    Without the cost, which is not in PyTorch: of the sum of all poses, to see how long it takes.
    """

    def slopes(place: Place) -> PushSequences:
        leaf = torch.from_numpy(place.sequences.copy()).requires_grad_()
        poses = rollout.rollout(place.search.scene, leaf)
        by_pose, by_push = np.ones(poses.shape), np.zeros(leaf.shape)
        if cost:
            by_pose, by_push = cost_slopes(place, poses.detach().numpy())
        poses.backward(torch.from_numpy(by_pose))
        assert leaf.grad is not None
        moving = place.sequences[..., LENGTH, None] > 0.0
        return np.asarray(UNIT * np.where(moving, leaf.grad.numpy() + by_push, 0.0))

    return slopes


def cost_slopes(place: Place, poses: ndarray) -> tuple[ndarray, ndarray]:
    """Return the cost's slopes by the predicted poses (S, H, N, 3) and by the pushes (S, H, 3)."""
    search = place.search
    count, horizon, disks, _ = poses.shape
    predicted = np.broadcast_to(search.scene, (count, horizon, *search.scene.shape)).copy()
    predicted[..., POSE] = poses

    def costs(poses: ndarray, pushes: ndarray) -> Scalars:
        there = predicted.copy()
        there[..., POSE] = poses
        rollout = make_rollout(search.scene, pushes, there, place.goal)
        return total_cost(cost_terms(rollout, CONFIG.weights, search.feasibility))

    by_pose, by_push = np.zeros_like(poses), np.zeros_like(place.sequences)
    for index in np.ndindex(horizon, disks, 3):
        nudge = np.zeros(poses.shape[1:])
        nudge[index] = TINY_STEP
        rise = costs(poses + nudge, place.sequences) - costs(poses - nudge, place.sequences)
        by_pose[:, *index] = rise / (2 * TINY_STEP)
    for step, number in np.ndindex(horizon, 3):
        nudge = np.zeros(place.sequences.shape[1:])
        nudge[step, number] = TINY_STEP
        rise = costs(poses, place.sequences + nudge) - costs(poses, place.sequences - nudge)
        by_push[:, step, number] = rise / (2 * TINY_STEP)
    return by_pose, by_push


def any_way(place: Place) -> PushSequences:
    """Return random directions: what a slope must do better than."""
    random = generator(0, "any way", len(place.sequences))
    moving = place.sequences[..., LENGTH, None] > 0.0
    return np.asarray(random.standard_normal(place.sequences.shape) * moving)


def row(
    name: str,
    slopes: Slopes,
    where: list[Place],
    step: float,
    exact: list[PushSequences] | None,
    timed: Slopes,
) -> str:
    """Return a line of the table."""
    taken = [slopes(place) for place in where]
    small, kept, best, fall = [], [], [], []
    for place, slope in zip(where, taken, strict=True):
        after = costs_after(place, slope, np.array([step, *CONFIG.gradient.rates()]))
        small.append(after[:, 0] < place.costs)
        largest = np.abs(slope).max(axis=(1, 2))
        promised = step * np.square(slope).sum(axis=(1, 2)) / np.maximum(largest, 1e-12)
        kept.append((place.costs - after[:, 0]) / np.maximum(promised, 1e-12))
        best.append(after[:, 1:].min(axis=1) < place.costs)
        fall.append(1.0 - np.minimum(after[:, 1:].min(axis=1) / place.costs, 1.0))
    cells = [f"{100 * np.mean(np.concatenate(share)):.0f} %" for share in (small, best, fall)]
    cells.insert(1, f"{np.median(np.concatenate(kept)):.2f}")
    cosines = "" if exact is None else f"{np.median(cosine(taken, exact)):.3f}"
    with on_threads(1):
        works = [{"slopes": partial(timed, place)} for place in where[:6]]
        time = np.median([fastest(work, 3)["slopes"].wall for work in works])
    return f"| {name} | {' | '.join(cells)} | {cosines} | {1e3 * time:.1f} |"


def costs_after(place: Place, slopes: PushSequences, rates: ndarray) -> ndarray:
    """Return what the sequences cost after steps of these lengths downhill, (S, R)."""
    largest = np.maximum(np.abs(slopes).max(axis=(1, 2), keepdims=True), 1e-12)
    downhill = -UNIT * slopes / largest
    tried = place.sequences[:, None] + rates[:, None, None] * downhill[:, None]
    tried = tried.reshape(-1, *place.sequences.shape[1:])
    limits = place.search.feasibility.limits
    return place.search.probe(inside_limits(tried, limits)).reshape(-1, len(rates))


def cosine(ones: list[PushSequences], others: list[PushSequences]) -> ndarray:
    """Return the cosines between slopes in every place."""
    one, other = (np.concatenate(all_).reshape(-1, 3 * CONFIG.horizon) for all_ in (ones, others))
    sizes = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    return np.asarray((one * other).sum(axis=1) / np.maximum(sizes, 1e-12))


def main() -> None:
    """Print a table for each model."""
    command = tyro.cli(Command, description=__doc__)
    console = Console(width=160, highlight=False)
    learned = load_sain(command.learned)
    rollout = DifferentiableRollout(learned)
    models = {
        f"network and planar prior ({command.sain})": load_dynamics(command.sain),
        "planar prior alone": load_dynamics("planar"),
        f"network alone ({command.learned})": learned,
    }
    for name, dynamics in models.items():
        where = places(as_rollout(dynamics), command)
        left = f"target {1e3 * np.median(distances(where)):.2f} mm from the goal at the end"
        console.print(f"\n{name}: {left}\n\n{HEAD}", markup=False)
        exact = by_autograd(rollout) if dynamics is learned else None
        known = [exact(place) for place in where] if exact else None
        ways = {f"differences of {size}": by_differences(size) for size in command.differences}
        if exact:
            ways["automatic differentiation"] = exact
        ways["random direction"] = any_way
        for way, slopes in ways.items():
            timed = by_autograd(rollout, cost=False) if slopes is exact else slopes
            line = row(way, slopes, where, command.step, known, timed)
            console.print(line, markup=False)


if __name__ == "__main__":
    main()
