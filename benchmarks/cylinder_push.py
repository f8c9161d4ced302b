"""judo's cylinder_push: judo's planner and ours, ``./env python -m benchmarks.cylinder_push``.

The same seeded episodes of judo's own task, 15 s each, as in its `run_mpc`. judo plans with its
defaults for this task, in its own controller, over the very physics that is played. Ours plans
strokes with a prior that is fitted to pushes in other episodes; time stands still while it plans,
and planning times are added to its times.

judo is optional:

    {install}
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from benchmarks.cylinder_planning import (
    LIMITS,
    ORACLE_PLANNER,
    CylinderOracle,
    cylinder_agent,
    fit_prior,
    own_pushes,
    push_errors,
)
from benchmarks.cylinder_world import EVERY, SCALE, STEPS, CylinderWorld
from benchmarks.peer_optimizers import INSTALL
from sain_core.bootstrap import bootstrap_mean
from sain_core.errors import SainError
from sain_core.goal import Goal
from sain_core.model import RolloutModel
from sain_core.seeding import generator
from sain_eval.loop.results import wilson_interval
from sain_model.evaluation.tables import markdown_table
from sain_mppi.agent.agent import Agent, act
from sain_mppi.agent.events import (
    Event,
    GoalGiven,
    PushDecision,
    PushEnded,
    PushExecuted,
    SceneObserved,
    Task,
)

OWN: Final = 0.3  # [m], judo's GOAL_DISTANCE_THRESHOLD
NEAR: Final = 0.01  # [m]
STOP: Final = 0.8 * NEAR * SCALE  # [m] in our units, at which our agent is content
EPISODE: Final = 1
JUDO: Final = ("cem", "mppi", "ps")


@dataclass(frozen=True)
class Options:
    """What to play."""

    episodes: int = 100
    """From seed 0 on."""
    planners: tuple[str, ...] = ("ours", *JUDO, "oracle")
    """cem is judo's default; the oracle is our planner over judo's physics."""
    learned: int = 25
    """Episodes of our pushes to which our prior is fitted."""


@dataclass(frozen=True)
class CylinderRecord:
    """An episode.

    Attributes:
        trace: distance [m] from the goal after each step.
        seconds: processor time of each plan.
        paused: of these, the time that passed until each step of the trace.
    """

    trace: np.ndarray
    seconds: np.ndarray
    paused: np.ndarray

    def reached(self, near: float) -> bool:
        """Tell whether the cart is near the goal at the end."""
        return bool(self.trace[-1] < near)

    def time_to(self, near: float, step: float) -> float:
        """Return when [s] it came near the goal for good."""
        away = np.flatnonzero(self.trace >= near)
        first = int(away[-1]) + 1 if len(away) else 0
        return step * (first + 1) + float(self.paused[first])


def play_judo(seed: int, world: CylinderWorld, optimizer: str) -> CylinderRecord:
    """Play an episode with judo's controller, which plans 25 times a second."""
    from judo.app.structs import MujocoState
    from judo.controller import make_controller

    controller, data = make_controller("cylinder_push", optimizer), world.task.data
    world.reset(seed)
    seconds = []

    def plan() -> None:
        state = MujocoState(data.time, data.qpos, data.qvel, data.xpos, data.xquat,
                            data.mocap_pos, data.mocap_quat, {})  # fmt: skip
        controller.update_states(state)
        begun = time.process_time()
        controller.update_action()
        seconds.append(time.process_time() - begun)

    plan()
    for number in range(STEPS):
        target = controller.compute(data)
        if number % EVERY == 0:
            plan()
        world.step(target)
    return CylinderRecord(np.array(world.trace), np.array(seconds), np.zeros(STEPS))


def play_ours(seed: int, world: CylinderWorld, agent: Agent) -> CylinderRecord:
    """Play an episode with our agent; once it is content, the pusher stays where it is."""
    scene, seconds, pauses = world.reset(seed), [], np.zeros(STEPS + 1)
    x, y = (SCALE * world.task.config.goal_pos).tolist()
    goal = Goal.place(x, y, STOP, body=0)
    event: Event = GoalGiven(Task(1, EPISODE, goal, 0))
    made = 0
    while not world.over:
        begun = time.process_time()
        decision = act(agent, event) or act(agent, SceneObserved(scene, EPISODE, made + 1))
        seconds.append(time.process_time() - begun)
        pauses[len(world.trace)] += seconds[-1]
        if not isinstance(decision, PushDecision):
            break
        push, push_id = decision.push, decision.push_id
        try:
            after = world.push(push)
        except SainError as error:
            event = PushEnded(push_id, error.code)
            continue
        event = PushExecuted(push_id, EPISODE, scene, push, after)
        scene, made = after, made + 1
    place = world.task.data.qpos[:2].copy()
    while not world.over:
        world.step(place)
    return CylinderRecord(np.array(world.trace), np.array(seconds), np.cumsum(pauses)[:STEPS])


Player = Callable[[int], CylinderRecord]


def row(name: str, records: Sequence[CylinderRecord], step: float) -> list[str]:
    """Return a row of the table."""
    cells = [name]
    for near in (OWN, NEAR):
        done = [record.time_to(near, step) for record in records if record.reached(near)]
        rate = wilson_interval(len(done), len(records))
        mean = bootstrap_mean(np.array(done), generator(0, "cylinder push", name))
        share = f"{100 * rate.low:.0f} to {100 * rate.high:.0f} %"
        cells.append(f"{len(done)} of {len(records)}, {share}")
        cells.append(f"{mean.estimate:.1f} [{mean.low:.1f}, {mean.high:.1f}]" if done else "")
    ever = sum(bool((record.trace < NEAR).any()) for record in records)
    last = np.median([1e3 * record.trace[-1] for record in records])
    plans = np.concatenate([record.seconds for record in records])
    busy = np.mean([record.seconds.sum() for record in records])
    return [*cells, str(ever), f"{last:.1f}", f"{1e3 * plans.mean():.1f}", f"{busy:.2f}"]


def learned_model(world: CylinderWorld, episodes: int, console: Console) -> RolloutModel:
    """Return our prior, fitted to pushes of other episodes."""
    pushes = own_pushes(world, episodes)
    prior = fit_prior(*pushes)
    off = push_errors(prior, *pushes) / SCALE
    console.print(
        f"our prior, fitted to {len(off)} pushes: off by {np.median(off):.1f} mm in the median,"
        f" {off.mean():.1f} in the mean; {prior.config}"
    )
    return prior


def main() -> None:
    """Play all episodes and print the table."""
    options = tyro.cli(Options, description=(__doc__ or "").format(install=INSTALL))
    console, seeds = Console(width=160, highlight=False), range(options.episodes)
    world = CylinderWorld(LIMITS)
    step = float(world.task.model.opt.timestep)
    model = learned_model(world, options.learned, console)
    players: dict[str, Player] = {
        "ours": lambda seed: play_ours(seed, world, cylinder_agent(model)),
        "oracle": lambda seed: play_ours(
            seed, world, cylinder_agent(CylinderOracle(), ORACLE_PLANNER)
        ),
        **{name: partial(play_judo, world=world, optimizer=name) for name in JUDO},
    }
    rows = []
    for name in options.planners:
        rows.append(row(name, [players[name](seed) for seed in track(seeds, name)], step))
        console.print(" | ".join(rows[-1]), markup=False)
    head = ["planner", f"within {OWN} m", "s until then", f"within {NEAR} m", "s until then"]
    head += ["ever", "mm left, median", "ms a plan", "s of planning"]
    console.print(markdown_table(head, rows), markup=False)


if __name__ == "__main__":
    main()
