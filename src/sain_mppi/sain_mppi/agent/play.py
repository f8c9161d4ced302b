"""An agent in a world: goals, one after another, without a reset between them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sain_core.errors import ConfigError, ErrorCode, SainError
from sain_core.scene import POSITION, is_settled
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_core.world import AnyWorld, DivergedError, PushRecord, WorldFailedError
from sain_mppi.agent.agent import Agent, act
from sain_mppi.agent.events import (
    EpisodeBegun,
    GoalGiven,
    PushDecision,
    PushEnded,
    SceneObserved,
    Stop,
    Task,
)
from sain_mppi.agent.goal_tracker import LOOK_AGAIN

EPISODE: Final = 1  # its id

Decision = PushDecision | Stop | None


class Sight:
    """How an agent sees a world, and pushes in it: exactly, and at once."""

    def __init__(self, world: AnyWorld[Any]) -> None:
        self.world = world

    @property
    def time(self) -> float:
        """The time [s] of results, by the clock of what is seen."""
        return 0.0

    def look(self) -> Iterator[tuple[Scene, float]]:
        """Yield scenes (N, 8) of a world at rest as they arrive, and when they were seen [s]."""
        yield self.world.observe(), self.time

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Execute a push that was planned from a scene as seen; return where it led."""
        return self.world.push(push).after


@dataclass(frozen=True, eq=False)
class Pursuit:
    """A goal, the scene (N, 8) in which it was given, and the pushes towards it."""

    task: Task
    start: Scene
    pushes: tuple[PushRecord, ...]


@dataclass(frozen=True, eq=False)
class PlayOutcome:
    """What became of an agent in a world.

    Attributes:
        pursuits: of all goals that were given, in order.
        final: (N, 8), the last scene.
        refusals: pushes that were not executed.
        fallbacks: pushes that physics planned because the model failed.
        failure: why it ended short of a goal; empty: it did not.
    """

    pursuits: tuple[Pursuit, ...]
    final: Scene
    refusals: int
    fallbacks: int
    failure: str


def play(
    agent: Agent, world: AnyWorld[Any] | Sight, tasks: Sequence[Task], bodies: Bodies
) -> PlayOutcome:
    """Let an agent reach goals in a world that was reset, one after another, or stop.

    Args:
        agent: a new one.
        world: the world, or how the agent sees it.
        tasks: each with its goal. A later one is given when the one before is reached.
        bodies: in the world.

    Raises:
        WorldFailedError: the world is broken.
    """
    playing = _Play(agent, world if isinstance(world, Sight) else Sight(world))
    act(agent, EpisodeBegun(EPISODE, bodies))
    pursuits: list[Pursuit] = []
    for task in tasks:
        start, first = playing.scene, len(playing.pushes)
        playing.pursue(task)
        pursuits.append(Pursuit(task, start, tuple(playing.pushes[first:])))
        if playing.failure:
            break
    counts = playing.refusals, playing.fallbacks
    return PlayOutcome(tuple(pursuits), playing.scene, *counts, playing.failure)


class _Play:
    """An episode while it goes on."""

    def __init__(self, agent: Agent, sight: Sight) -> None:
        self._agent, self._sight = agent, sight
        self.scene = sight.world.observe()
        self.pushes: list[PushRecord] = []
        self.refusals = self.fallbacks = 0
        self.failure = ""

    def pursue(self, task: Task) -> None:
        """Push until the agent stops; `failure` is why it stopped short of the goal.

        Raises:
            ConfigError: the agent's settings or its cost are wrong, for every scene.
        """
        decision = act(self._agent, GoalGiven(task))
        while not self.failure:
            decision = decision or self._look()
            if isinstance(decision, Stop) and isinstance(decision.error, ConfigError):
                raise decision.error
            if not isinstance(decision, PushDecision):
                self.failure = decision.failure if decision else self._unsettled()
                return
            decision = self._carry_out(decision)

    def _look(self) -> Decision:
        """Let the agent look until it decides; None: there is nothing that it can decide on."""
        settled, ids = bool(is_settled(self.scene)), (EPISODE, len(self.pushes) + 1)
        for scene, time in self._sight.look():
            decision = act(self._agent, SceneObserved(scene, *ids, settled, time))
            if decision is not None:
                return decision
        return None

    def _carry_out(self, decision: PushDecision) -> Decision:
        """Execute a push; return what the agent decides once it has the result."""
        before, push, push_id = self.scene, decision.push, decision.push_id
        begun = self._sight.time
        try:
            after = self._sight.push(push, decision.job.observed.scene)
        except WorldFailedError:
            raise
        except SainError as error:
            self.refusals += 1
            if isinstance(error, DivergedError) or error.code in LOOK_AGAIN:
                self.failure = f"{type(error).__name__}: {error}"  # no other scene is to come
                return None
            return act(self._agent, PushEnded(push_id, error.code))
        time = 0.0 if decision.plan is None else decision.plan.times.total
        took = self._sight.time - begun
        record = PushRecord(
            push, before, after, decision.predicted, planning_time=time, duration=took
        )
        self.pushes.append(record)
        self.fallbacks += decision.failure is not None
        self.scene = after
        ended = PushEnded(push_id, ErrorCode.OK, self._sight.time, record, EPISODE)
        return act(self._agent, ended)

    def _unsettled(self) -> str:
        """Return why there is no scene to decide on."""
        off = ~self._agent.config.feasibility.table.contains(self.scene[:, POSITION])
        if off.any():
            body = int(np.argmax(off))
            x, y = self.scene[body, POSITION]
            return (
                f"push {len(self.pushes)} moved body {body} off the table, to ({x:.3f}, {y:.3f}) m"
            )
        return f"the scene did not settle after push {len(self.pushes)}"
