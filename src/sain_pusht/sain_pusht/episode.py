"""An episode of gym-pusht: the agent decides, strokes become targets of the disk."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.world import PushRecord
from sain_mppi.agent.agent import Agent
from sain_mppi.agent.decision import Task
from sain_mppi.agent.play import PlayOutcome, play
from sain_pusht.block import goal_of
from sain_pusht.world import PushtWorld

NEAR: Final = 0.0008  # [m]: the agent goes on until gym-pusht itself counts a success
TURNED: Final = 0.008  # [rad]


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
        planning_s: time [s] of the plan of each stroke.
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


def play_pusht(seed: int, agent: Agent, world: PushtWorld) -> tuple[PushtRecord, PlayOutcome]:
    """Play the episode of a seed until gym-pusht ends it, or the agent stops."""
    world.reset(seed)
    task = Task(1, 0, goal_of(world.goal, NEAR, TURNED), 0)
    episode = play(agent, world, [task], world.bodies, lambda: world.over)
    pushes = episode.pursuits[0].pushes
    mm, deg = np.array([_errors(push) for push in pushes]).reshape(-1, 2).T.tolist()
    record = PushtRecord(
        seed,
        world.success,
        world.steps,
        world.free_steps,
        len(pushes),
        episode.refusals,
        world.best,
        tuple(push.planning_time for push in pushes),
        tuple(mm),
        tuple(deg),
        "" if world.over else episode.failure or "the agent stopped",
    )
    return record, episode


def _errors(push: PushRecord) -> tuple[float, float]:
    """Return how far a push led from where it was predicted to lead [mm, degrees]."""
    if push.predicted is None:
        return float("nan"), float("nan")
    off = (push.after - push.predicted)[0]
    turn = np.abs(np.angle(np.exp(1j * off[2])))
    return 1e3 * float(np.hypot(off[0], off[1])), float(np.degrees(turn))
