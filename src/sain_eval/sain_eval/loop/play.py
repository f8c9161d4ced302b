"""An agent in a world: goals, one after another, without a reset between them."""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sain_core.errors import ConfigError, ErrorCode, SainError
from sain_core.goal import Goal
from sain_core.scene import POSITION, Table, is_settled
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_core.world import AnyWorld, DivergedError, PushRecord, WorldFailedError
from sain_eval.episode import EpisodeRecord
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
NOT_SETTLED: Final = "the scene did not settle after push {}"

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


@dataclass(frozen=True)
class EpisodeOutcome:
    """What became of an episode."""

    records: tuple[EpisodeRecord, ...]  # one for each goal that was given, in order
    final: Scene  # (N, 8), the last scene
    refusals: int = 0  # pushes that were not executed
    fallbacks: int = 0  # pushes that physics planned because the model failed
    failure: str = ""  # why it ended short of the tightest tolerance; empty: it did not

    @property
    def record(self) -> EpisodeRecord:
        """The record of the last goal."""
        return self.records[-1]


class Play:
    """An agent's episode while it goes on, whoever executes the pushes.

    Attributes:
        scene: (N, 8), as it is.
        records: the pushes towards each goal that was pursued to its end.
        refusals: pushes that were not executed.
        fallbacks: pushes that physics planned because the model failed.
        failure: why it ended short of a goal; empty: it did not. Once it is set, no push follows.
    """

    def __init__(self, agent: Agent, sight: Sight) -> None:
        """Begin with the scene that the world is in."""
        self._agent, self._sight = agent, sight
        self.scene = sight.world.observe()
        self.records: list[EpisodeRecord] = []
        self._count = self.refusals = self.fallbacks = 0
        self.failure = ""

    def pushes(
        self, goals: Sequence[Goal], bodies: Bodies, max_pushes: int
    ) -> Generator[PushDecision, PushRecord, None]:
        """Yield pushes towards one goal after another; each is to be answered with its record.

        Raises `ConfigError`: the agent's settings or its cost are wrong, for every scene.
        """
        act(self._agent, EpisodeBegun(EPISODE, bodies))
        for number, goal in enumerate(goals, start=1):
            start, made = self.scene, list[PushRecord]()
            decision = act(self._agent, GoalGiven(Task(number, 0, goal, max_pushes)))
            while (decision := self._next(decision)) is not None:
                record = yield decision
                if record.code == ErrorCode.OK:
                    made.append(record)
                decision = self._take(decision, record)
            self.records.append(EpisodeRecord(goal, tuple(made), start, bodies))
            if self.failure:
                return

    def _next(self, decision: Decision) -> PushDecision | None:
        """Return the next push; None: the goal is reached, or there is a failure."""
        match None if self.failure else decision or self._look():
            case PushDecision() as push:
                return push
            case Stop(error=ConfigError() as error):
                raise error
            case Stop() as stop:
                self.failure = stop.failure
            case None:
                self.failure = self.failure or self._unsettled()
        return None

    def _take(self, decision: PushDecision, record: PushRecord) -> Decision:
        """Take what came of a push; return what the agent decides then."""
        if record.code != ErrorCode.OK:
            self.refusals += 1
            refused = PushEnded(decision.push_id, record.code, message=record.message)
            return None if self.failure else act(self._agent, refused)
        self.scene, self._count = record.after, self._count + 1
        self.fallbacks += decision.failure is not None
        ended = PushEnded(decision.push_id, ErrorCode.OK, self._sight.time, record, EPISODE)
        return act(self._agent, ended)

    def _look(self) -> Decision:
        """Let the agent look until it decides; None: there is nothing that it can decide on."""
        settled, ids = bool(is_settled(self.scene)), (EPISODE, self._count + 1)
        for scene, time in self._sight.look():
            decision = act(self._agent, SceneObserved(scene, *ids, settled, time))
            if decision is not None:
                return decision
        return None

    def _unsettled(self) -> str:
        table = self._agent.config.feasibility.table
        return why_lost(self.scene, self._count, table) or NOT_SETTLED.format(self._count)


def play(
    agent: Agent,
    world: AnyWorld[Any] | Sight,
    goals: Sequence[Goal],
    bodies: Bodies,
    max_pushes: int,
) -> EpisodeOutcome:
    """Let a new agent reach goals in a world that was reset, one after another, or stop.

    Args:
        agent: a new one.
        world: the world, or how the agent sees it.
        goals: a later one is given when the one before is reached.
        bodies: in the world.
        max_pushes: for each goal; 0: any number.

    Raises:
        WorldFailedError: the world is broken.
    """
    sight = world if isinstance(world, Sight) else Sight(world)
    playing = Play(agent, sight)
    pushes = playing.pushes(goals, bodies, max_pushes)
    decision = next(pushes, None)
    while decision is not None:
        try:
            decision = pushes.send(_executed(playing, sight, decision))
        except StopIteration:
            break
    counts = playing.refusals, playing.fallbacks
    return EpisodeOutcome(tuple(playing.records), playing.scene, *counts, playing.failure)


def _executed(playing: Play, sight: Sight, decision: PushDecision) -> PushRecord:
    """Execute a push; return its record. After some errors there is no scene to go on from."""
    push, before, begun = decision.push, playing.scene, sight.time
    try:
        after = sight.push(push, decision.job.observed.scene)
    except WorldFailedError:
        raise
    except SainError as error:
        if is_final(error):
            playing.failure = f"{type(error).__name__}: {error}"
        return PushRecord(push, before, before, code=error.code, message=str(error))
    time = 0.0 if decision.plan is None else decision.plan.times.total
    took = sight.time - begun
    return PushRecord(push, before, after, decision.predicted, planning_time=time, duration=took)


def why_lost(scene: Scene, pushes: int, table: Table) -> str:
    """Return why no push can follow in a scene (N, 8) after so many; empty: one can."""
    off = ~table.contains(scene[:, POSITION])
    if off.any():
        body = int(np.argmax(off))
        x, y = scene[body, POSITION]
        return f"push {pushes} moved body {body} off the table, to ({x:.3f}, {y:.3f}) m"
    return "" if is_settled(scene) else NOT_SETTLED.format(pushes)


def is_final(error: SainError) -> bool:
    """Return True if a push was refused so that no other scene, and no other push, can follow."""
    return isinstance(error, DivergedError) or error.code in LOOK_AGAIN
