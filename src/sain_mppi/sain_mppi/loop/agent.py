"""From a job to a decision: the planner, its model and the physics behind it, put together."""

from dataclasses import dataclass, replace
from time import monotonic
from typing import Final

from sain_core.dynamics import RolloutModel
from sain_core.errors import SainError
from sain_core.feasibility import Feasibility
from sain_core.history import PushHistory
from sain_core.seeding import generator
from sain_mppi.loop.fallback import FallbackRollout
from sain_mppi.loop.goal_tracker import Job, Task
from sain_mppi.loop.progress_monitor import Replanner
from sain_mppi.planner import Planner
from sain_mppi.search.config import PlannerConfig
from sain_mppi.search.result import PlanResult

MODEL_SHARE: Final = 0.8  # of the time for a plan: if the model is silent so long, physics plans


@dataclass(frozen=True)
class Decision:
    """What to push, and what the plan rests on.

    Attributes:
        job: what was decided on.
        result: the plan.
        failure: why the model was not used; None: it was.
    """

    job: Job
    result: PlanResult
    failure: SainError | None


class Decider:
    """Plans one job after another. All but `cancel` belongs to one thread."""

    def __init__(
        self,
        model: RolloutModel,
        physics: RolloutModel,
        config: PlannerConfig,
        feasibility: Feasibility,
        seed: int,
    ) -> None:
        """Plan with this model, and with physics while it fails."""
        self._model = FallbackRollout(model, physics)
        self._planner = Replanner(Planner(self._model, config, feasibility))
        self._time = config.deadline
        self._seed = seed
        self._episode: tuple[Task, int] | None = None

    def decide(self, job: Job, history: PushHistory | None = None) -> Decision:
        """Plan a job; the same seed, job and history give the same plan.

        Args:
            job: what to decide on.
            history: the earlier pushes of the episode; None: not known.

        Raises:
            CancelledError: `cancel` was called.
            NoPushError, NoProgressError, UnreachableError: there is no push to make.
            SainError: a scene that cannot exist, or a disk off the table.
        """
        started = monotonic()
        episode = job.task, job.view.episode_id
        if episode != self._episode:
            self._planner.reset()
            self._episode = episode
        self._model.inform(history or PushHistory.empty(len(job.view.scene)))
        self._model.until(started + MODEL_SHARE * self._time if self._time else None)
        names = (job.task.goal_id, *job.view.key, job.attempt)
        random = generator(self._seed, "plan", *names)
        deadline = started + self._time if self._time else None
        result = self._planner.plan(job.view.scene, job.task.goal, random, deadline)
        return Decision(job, result, self._model.failure)

    def complete(self, decision: Decision) -> Decision:
        """Return the latest decision with what its push need not wait for: the model's regions."""
        if decision.failure is not None:
            return decision
        result = self._planner.complete(decision.job.view.scene, decision.result)
        return replace(decision, result=result)

    def refused(self, decision: Decision, for_itself: bool) -> None:
        """Take note that a decision's push was refused, for itself or for its scene."""
        if for_itself:
            self._planner.refuse(decision.result.push)
        else:
            self._planner.reset()

    def begin(self) -> None:
        """Make ready for a new job."""
        self._model.begin()

    def cancel(self) -> None:
        """Let the job under way end soon. For any thread."""
        self._model.cancel()
