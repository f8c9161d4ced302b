"""What happens to an agent, what it decides on, and what it wants done.

`Agent.update` turns an `Event` into `Action`s.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import cached_property
from threading import Event as Flag

import numpy as np

from sain_core.errors import CancelledError, ErrorCode, SainError
from sain_core.goal import Goal, Judgement
from sain_core.scene import MASS, POSITION, RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PushArray, Scalars, Scene
from sain_core.world import PushRecord
from sain_mppi.agent.dead_end import DeadEnd
from sain_mppi.agent.uncertainty import Uncertainty
from sain_mppi.algorithms.sampling import PlanResult
from sain_mppi.config import PlannerConfig
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
class EpisodeBegun:
    """An episode has these bodies. Without this event, all are disks.

    If it comes again for the same episode, with another time [s] or none, then whoever executes
    pushes began anew, and the push under way has no result.
    """

    episode_id: int
    bodies: Bodies
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class SceneObserved:
    """A scene (N, 8), with the ids by which pushes refer to it."""

    scene: Scene  # (N, 8)
    episode_id: int  # of its episode
    scene_id: int  # changes with each push
    settled: bool = True  # whether the bodies are at rest
    time: float = 0.0  # of the observation [s], by the clock of the results
    bodies_follow: bool = False  # its episode has an `EpisodeBegun`, which may not have come yet
    received: float = 0.0  # when it arrived [s], by the agent's own clock; the agent fills it in
    uncertainty: Uncertainty | None = None  # of the poses; None: they are exact

    @property
    def key(self) -> tuple[int, int]:
        """The ids by which pushes refer to the scene."""
        return self.episode_id, self.scene_id


@dataclass(frozen=True, eq=False)
class PushEnded:
    """A push, whoever sent it, was executed or refused."""

    push_id: int  # of the push
    code: int = ErrorCode.OK  # of `sain_core.errors.ErrorCode`; OK: it was executed
    time: float = 0.0  # when it ended [s], by the clock of the scenes
    record: PushRecord | None = None  # of a push that was executed; None: its scenes are unknown
    episode_id: int = 0  # of the record
    message: str = ""  # why it was refused


@dataclass(frozen=True, eq=False)
class GoalGiven:
    """A goal replaces the one before. `pushes` were sent for it already."""

    task: Task
    pushes: int = 0


@dataclass(frozen=True, eq=False)
class GoalCancelled:
    """No goal is to be followed any more. A push under way is executed to its end."""

    error: BaseException = CancelledError("the goal was cancelled")


@dataclass(frozen=True)
class TimePassed:
    """Time passed, by the agent's own clock: what was waited for may not come any more."""


@dataclass(frozen=True, eq=False)
class PlanJob:
    """One settled scene to decide on, for one goal."""

    task: Task  # the goal
    observed: SceneObserved  # the scene, as it was observed
    problem: Problem  # scene and goal, checked
    # a number that changes with goal and episode, and after a refusal for the scene: what a decider
    # keeps from job to job holds within one session
    session: int
    pushes: int  # sent for this goal before, without refused ones
    history: PushHistory = field(default_factory=PushHistory.empty)  # the episode's earlier pushes
    cancelled: Flag = field(default_factory=Flag)  # set once the decision is no longer wanted

    @cached_property
    def judgement(self) -> Judgement:
        """How far the scene is from the goal."""
        problem = self.problem
        table = problem.feasibility.table
        return problem.goal.judge(self.observed.scene, problem.start, problem.bodies, table)

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
        uncertainty = self.observed.uncertainty
        if uncertainty is None:
            return self.judgement.reached
        return uncertainty.is_reached(self.judgement) and self.moved is None

    @property
    def moved(self) -> int | None:
        """The first body that was to be kept and was moved, if any."""
        uncertainty = self.observed.uncertainty
        slack = 0.0 if uncertainty is None else SLACK * float(uncertainty.places.max())
        return self.judgement.moved(slack)

    @property
    def stream(self) -> tuple[str, int, int]:
        """The name of the job's random stream below the agent's seed.

        It is made of the goal, the disks at the session's start, and the numbers of pushes and
        refusals since. It holds no id of a message: who plays the same episode draws the same.
        """
        disks = self.problem.start[:, [*range(POSITION.stop), MASS, RADIUS]]
        words = np.concatenate([self.problem.goal.numbers, disks.ravel()])
        words = words.round(STREAM_DECIMALS) + 0.0
        return words.tobytes().hex(), self.pushes, len(self.problem.refused)


@dataclass(frozen=True, eq=False)
class PushDecision:
    """A push to carry out, and what it rests on."""

    job: PlanJob  # what was decided on
    push: PushArray  # (5,)
    plan: PlanResult | None = None  # the plan that the push begins; None: it was not planned
    # why physics planned in place of the model; None: the model did
    failure: SainError | None = None
    warning: str = ""  # why the plan is wider than by default; empty: it is not
    # (N,) [m], from where the push before should have led to where it led; None: there was none, or
    # nobody compares
    last_errors: Scalars | None = None
    last_expected: Scalars | None = None  # (N,) [m], errors up to these are expected
    push_id: int = 0  # of the push, once the agent counts it as sent
    settings: PlannerConfig | None = None  # what was planned with; None: it was not planned
    dead_end: DeadEnd | None = None  # why pushes bring a body no nearer; None: they do

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


@dataclass(frozen=True, eq=False)
class Decided:
    """The work on a job has ended. No outcome: it was cancelled."""

    outcome: PushDecision | Stop | None


@dataclass(frozen=True, eq=False)
class Completed:
    """A decision whose push is sent, with what the push need not wait for."""

    decision: PushDecision


@dataclass(frozen=True)
class Prepared:
    """The work ahead, while a push is executed, has ended."""


Event = (
    EpisodeBegun | SceneObserved | PushEnded | GoalGiven | GoalCancelled
    | TimePassed | Decided | Completed | Prepared
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Computation:
    """What takes long. Its event goes back to `Agent.update`.

    An agent's computations run in the order in which it asks for them, on any one thread.
    """

    run: Callable[[], Event]  # compute, and return the event
    # return the event that replaces it, if `run` raised what it never should
    failed: Callable[[BaseException], Event]


Action = PushDecision | Stop | Computation
"""Send a push; send no more, and why; compute. No action: wait for an event."""
