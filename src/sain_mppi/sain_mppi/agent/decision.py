"""What goes into the agent and what comes out of it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import cached_property
from threading import Event

import numpy as np

from sain_core.errors import ConfigError, SainError
from sain_core.goal import Goal, Judgement
from sain_core.history import PushHistory
from sain_core.scene import MASS, POSITION, RADIUS, Table
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene
from sain_mppi.agent.progress_monitor import Surprise
from sain_mppi.agent.uncertainty import Uncertainty
from sain_mppi.algorithms.config import PlannerConfig
from sain_mppi.algorithms.result import PlanResult
from sain_mppi.objective.problem import Problem

SLACK = 4.0  # standard deviations: a body that was to be kept is moved when seen further off
STREAM_DECIMALS = 6  # of the numbers that name a random stream: 1 um, far above rounding


@dataclass(frozen=True, eq=False)
class Task:
    """A goal as it was given. Episode 0: any. No pushes: no limit."""

    goal_id: int
    episode_id: int
    goal: Goal
    max_pushes: int


@dataclass(frozen=True, eq=False)
class View:
    """A scene (N, 8) as it arrived, with the ids that a push gives it, and when [s].

    Attributes:
        observed: when it was observed [s], by the clock of the results of pushes.
        sure: how sure the poses are; None: they are exact.
    """

    scene: Scene
    episode_id: int
    scene_id: int
    settled: bool
    received: float
    observed: float = 0.0
    sure: Uncertainty | None = None

    @property
    def key(self) -> tuple[int, int]:
        """The ids by which a push names the scene."""
        return self.episode_id, self.scene_id


@dataclass(frozen=True, eq=False)
class PlanJob:
    """One settled scene to decide on, for one goal.

    Attributes:
        task: the goal.
        view: the scene.
        start: (N, 8), the first scene that was decided on in this session.
        session: a number that changes with goal and episode, and after a refusal for the scene:
            what a decider keeps from job to job holds within one session.
        pushes: sent for this goal before, without refused ones.
        refused: (5,) each, pushes that were refused from this scene.
        history: the episode's earlier pushes.
        cancelled: set once the decision is no longer wanted.
        bodies: shapes and roles.
        table: that they stand on.
    """

    task: Task
    view: View
    start: Scene
    session: int
    pushes: int
    refused: tuple[PushArray, ...] = ()
    history: PushHistory = field(default_factory=PushHistory.empty)
    cancelled: Event = field(default_factory=Event)
    bodies: Bodies = PAPER_DISKS
    table: Table = Table()

    @property
    def known_bodies(self) -> Bodies:
        """Shapes and roles."""
        return self.bodies.fitted(len(self.view.scene))

    @property
    def goal(self) -> Goal:
        """The goal of the task, in this scene."""
        return self.task.goal.fitted(len(self.view.scene))

    @cached_property
    def problem(self) -> Problem:
        """Scene and goal, checked.

        Raises:
            InvalidInputError, OffTableError: see `Problem.of`.
        """
        return Problem.of(self.view.scene, self.goal, self.bodies, self.start, self.table)

    def check(self) -> None:
        """Check scene and goal, once.

        Raises:
            InvalidInputError, OffTableError: see `problem`.
            OutOfRangeError: tolerances that are too small for what is observed.
        """
        goal = self.problem.goal
        if self.view.sure is not None:
            self.view.sure.check_tolerance(goal)

    @cached_property
    def judgement(self) -> Judgement:
        """How far the scene is from the goal."""
        return self.goal.judge(self.view.scene, self.start, self.known_bodies, self.table)

    @property
    def left(self) -> str:
        """What is left to do, for messages."""
        judged = self.judgement
        return ", ".join(
            f"body {judged.goal.poses[number].body} {1e3 * judged.distances[number]:.1f} mm and"
            f" {judged.turns[number]:.3f} rad from its pose"
            for number in judged.missed
        )

    @property
    def reached(self) -> bool:
        """Whether the goal is reached; where poses are uncertain, with enough probability."""
        sure = self.view.sure
        if sure is None:
            return self.judgement.reached
        return sure.reached(self.judgement) >= sure.confidence and self.moved is None

    @property
    def moved(self) -> int | None:
        """The first body that was to be kept and was moved, if any."""
        sure = self.view.sure
        return self.judgement.moved(0.0 if sure is None else SLACK * float(sure.places.max()))

    @property
    def stream(self) -> tuple[str, int, int]:
        """The name of the job's random stream below the agent's seed.

        It is made of the goal, the disks at the session's start, and the numbers of pushes and
        refusals since. It holds no id from the wire: whoever plays the same episode draws the same.
        """
        disks = self.start[:, [*range(POSITION.stop), MASS, RADIUS]]
        words = np.concatenate([self.goal.numbers, disks.ravel()]).round(STREAM_DECIMALS) + 0.0
        return words.tobytes().hex(), self.pushes, len(self.refused)


@dataclass(frozen=True, eq=False)
class PushDecision:
    """A push to carry out, and what it rests on.

    Attributes:
        job: what was decided on.
        push: (5,).
        plan: the plan that the push begins; None: it was not planned.
        failure: why physics planned in place of the model; None: the model did.
        concern: why the plan is wider than usual; empty: it is not.
        last: what became of the push before; None: there was none, or nobody compares.
        push_id: of the push, once the agent counts it as sent.
        settings: what the planner was asked to plan with; None: it was not planned.
    """

    job: PlanJob
    push: PushArray
    plan: PlanResult | None = None
    failure: SainError | None = None
    concern: str = ""
    last: Surprise | None = None
    push_id: int = 0
    settings: PlannerConfig | None = None

    @property
    def predicted(self) -> Scene | None:
        """The scene (N, 8) after the push, as predicted."""
        return None if self.plan is None else self.plan.predicted[0]


class StopReason(Enum):
    """Why the agent sends no push."""

    REACHED = auto()
    EXHAUSTED = auto()
    FAILED = auto()


@dataclass(frozen=True, eq=False)
class Stop:
    """No push, and why: the goal is reached, the pushes are used up, or there is an error.

    `job` is what was decided on; None: the goal itself cannot be served.
    """

    task: Task
    reason: StopReason
    job: PlanJob | None = None
    error: BaseException | None = None

    @property
    def failure(self) -> str:
        """Why the goal was not reached; empty: it was."""
        if self.reason is StopReason.EXHAUSTED and self.job is not None:
            return f"{self.task.max_pushes} pushes left {self.job.left}"
        return "" if self.error is None else f"{type(self.error).__name__}: {self.error}"


class Decider(ABC):
    """Chooses the push for one job after another. All but `adjust` belong to one thread."""

    @abstractmethod
    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Choose a push; the same jobs and generators give the same pushes.

        Raises:
            CancelledError: the job was cancelled.
            SainError: there is no push to make, and why.
        """

    def prepare(self, decision: PushDecision, generator: np.random.Generator) -> bool:
        """Work ahead on what follows on the latest decision, while its push is executed.

        Returns:
            Whether there was anything to prepare.

        Raises:
            CancelledError: the decision's job was cancelled.
        """
        return False

    def complete(self, decision: PushDecision) -> PushDecision:
        """Return the latest decision with what its push need not wait for."""
        return decision

    def adjust(self, planner: PlannerConfig) -> None:
        """Plan with other settings from the next job on; raise `ConfigError` if it has none."""
        raise ConfigError(f"{type(self).__name__} does not plan: it has no settings to change")
