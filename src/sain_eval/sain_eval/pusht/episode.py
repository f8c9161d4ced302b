"""An episode of gym-pusht: the agent decides, strokes become targets of the disk."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.errors import SainError
from sain_core.types import PushArray, Scene
from sain_eval.pusht.block import goal_of
from sain_eval.pusht.world import PushtWorld
from sain_mppi.loop.agent import Agent, act
from sain_mppi.loop.decision import PushDecision, Task
from sain_mppi.loop.events import EpisodeBegun, GoalGiven, PushEnded, PushExecuted, SceneSeen

EPISODE: Final = 1
NEAR: Final = 0.0008  # [m]: the agent goes on until gym-pusht itself counts a success
TURNED: Final = 0.008  # [rad]

Watch = Callable[[Scene, PushArray, Scene], None]  # scene, push, next scene


@dataclass(frozen=True)
class PushtRecord:
    """What became of an episode.

    Attributes:
        seed: of `env.reset`.
        success: as gym-pusht counts it.
        steps: of control, all of them.
        free_steps: those of them that led to where strokes start.
        pushes: strokes.
        refusals: strokes that could not begin.
        best_coverage: largest coverage of the goal.
        planning_s: time [s] of each plan.
        error_mm: distance [mm] from predicted to observed place, of each stroke.
        error_deg: turn between predicted and observed heading [deg], of each stroke.
        failure: why the agent stopped before the end; empty: it did not.
    """

    seed: int
    success: bool
    steps: int
    free_steps: int
    pushes: int
    refusals: int
    best_coverage: float
    planning_s: tuple[float, ...]
    error_mm: tuple[float, ...]
    error_deg: tuple[float, ...]
    failure: str = ""


def play(
    seed: int, agent: Agent, world: PushtWorld, watch: Watch = lambda scene, push, after: None
) -> PushtRecord:
    """Play the episode of a seed until gym-pusht ends it, or the agent stops."""
    scene = world.reset(seed)
    task = Task(1, EPISODE, goal_of(world.goal, NEAR, TURNED), NEAR, 0)
    decision = act(agent, EpisodeBegun(EPISODE, world.bodies), GoalGiven(task))
    times: list[float] = []
    errors: list[tuple[float, float]] = []
    refusals, failure = 0, ""
    while not world.over:
        decision = decision or act(agent, SceneSeen(scene, EPISODE, len(errors) + 1))
        if not isinstance(decision, PushDecision):
            failure = (decision.failure if decision else "") or "the agent stopped"
            break
        push, push_id = decision.push, decision.push_id
        times.append(decision.plan.times.total if decision.plan else 0.0)
        try:
            after = world.push(push)
        except SainError as error:
            refusals += 1
            decision = act(agent, PushEnded(push_id, error.code))
            continue
        errors.append(_errors(decision, after))
        watch(scene, push, after)
        decision = act(agent, PushExecuted(push_id, EPISODE, scene, push, after))
        scene = after
    return _record(seed, world, times, errors, refusals, failure)


def _record(
    seed: int,
    world: PushtWorld,
    times: list[float],
    errors: list[tuple[float, float]],
    refusals: int,
    failure: str,
) -> PushtRecord:
    mm, deg = np.array(errors).reshape(-1, 2).T.tolist()
    return PushtRecord(
        seed,
        world.success,
        world.steps,
        world.free_steps,
        len(errors),
        refusals,
        world.best,
        tuple(times),
        tuple(mm),
        tuple(deg),
        failure,
    )


def _errors(decision: PushDecision, after: Scene) -> tuple[float, float]:
    expected = decision.predicted
    if expected is None:
        return float("nan"), float("nan")
    off = (after - expected)[0]
    turn = np.abs(np.angle(np.exp(1j * off[2])))
    return 1e3 * float(np.hypot(off[0], off[1])), float(np.degrees(turn))
