"""From a job to a decision: the planner, its model and the physics behind it, put together."""

from dataclasses import dataclass

from sain_core.dynamics import RolloutModel
from sain_core.errors import SainError
from sain_core.feasibility import Feasibility
from sain_core.history import PushHistory
from sain_core.seeding import generator
from sain_mppi.config import PlannerConfig
from sain_mppi.fallback import FallbackRollout
from sain_mppi.planner import Planner
from sain_mppi.pursuit import Job, Task
from sain_mppi.result import PlanResult


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
        self._planner = Planner(self._model, config, feasibility)
        self._seed = seed
        self._task: Task | None = None

    def decide(self, job: Job, history: PushHistory | None = None) -> Decision:
        """Plan a job; the same seed, job and history give the same plan.

        Args:
            job: what to decide on.
            history: the earlier pushes of the episode; None: not known.

        Raises:
            CancelledError: `cancel` was called.
            NoPushError: there is no push to make.
            SainError: a scene that cannot exist, or a disk off the table.
        """
        if job.task is not self._task:
            self._planner.reset()
            self._task = job.task
        self._model.inform(history or PushHistory.empty(len(job.view.scene)))
        names = (job.task.goal_id, *job.view.key, job.attempt)
        random = generator(self._seed, "plan", *names)
        result = self._planner.plan(job.view.scene, job.task.goal, random)
        return Decision(job, result, self._model.failure)

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
