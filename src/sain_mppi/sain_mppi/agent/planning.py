"""From a job to a push: the planner, its model, the physics behind it, and the progress."""

from dataclasses import replace
from time import monotonic
from typing import Final

import numpy as np

from sain_core.errors import NoProgressError
from sain_core.feasibility import Feasibility
from sain_core.model import RolloutModel
from sain_mppi.agent.decision import Decider, PlanJob, PushDecision
from sain_mppi.agent.fallback import FallbackRollout, Patience
from sain_mppi.agent.progress_monitor import ProgressMonitor
from sain_mppi.algorithms.config import PlannerConfig
from sain_mppi.algorithms.proposals import RESET
from sain_mppi.objective.objective import Objective
from sain_mppi.planner import Planner

SHORTEST: Final = 4.0  # standard deviations of places: a shorter way of a body is lost in noise
MODEL_SHARE: Final = 0.8  # of the time for a plan: a model that is silent so long is late


class PlanningDecider(Decider):
    """Plans with a model, with physics while the model fails, and wider after a surprise."""

    def __init__(
        self,
        model: RolloutModel,
        physics: RolloutModel,
        config: PlannerConfig,
        feasibility: Feasibility,
        patience: Patience | None = None,
    ) -> None:
        """Plan with this model, or else with this physics."""
        self._model, self._physics = model, physics
        self._patience = patience or Patience()
        self._planner = Planner(model, config, feasibility)
        self._monitor = ProgressMonitor(config.progress)
        self._config, self._feasibility = config, feasibility
        self._session: int | None = None

    def adjust(self, planner: PlannerConfig) -> None:
        """Plan with other settings from the next job on."""
        self._config = planner

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Plan from the job's scene and take the first push.

        Raises:
            CancelledError: the job was cancelled.
            NoPushError, NoProgressError, UnreachableError: there is no push to make.
            SainError: a scene that cannot exist, or a disk off the table.
        """
        config = self._config
        started, time = monotonic(), config.deadline
        self._planner.use(config)
        self._monitor.use(config.progress)
        if job.session != self._session:
            self._planner.reset()
            self._monitor.reset()
            self._session = job.session
        self._patience.until = started + MODEL_SHARE * time if time else None
        self._patience.cancelled = job.cancelled
        model = self._planner.model = FallbackRollout(
            self._model, self._physics, job.history, job.bodies, self._patience
        )
        self._look(job)
        concern = self._monitor.concern
        plan = self._planner.plan(
            job.problem,
            generator,
            deadline=started + time if time else None,
            wide=bool(concern),
            refused=job.refused,
            shortest=shortest_way(job),
        )
        self._monitor.expect(job.view.scene, plan.predicted[0])
        failure, last = model.failure, self._monitor.last
        return PushDecision(job, plan.push, plan, failure, concern, last, settings=config)

    def _look(self, job: PlanJob) -> None:
        """Compare the scene with what was expected; raise when it is no use going on."""
        scene, monitor = job.view.scene, self._monitor
        weights = self._planner.config.weights
        goal = Objective(job.goal, job.start, weights, self._feasibility, job.bodies)
        sure = job.view.sure
        monitor.look(scene, goal.rest_cost(scene), None if sure is None else 3.0 * sure.places)
        if monitor.hopeless:
            raise NoProgressError(
                f"{monitor.without} pushes in a row brought nothing, the distance is"
                f" {1e3 * job.judgement.distance:.0f} mm; choose another goal, move a body,"
                f" send the goal again, or {RESET}"
            )

    def prepare(self, decision: PushDecision, generator: np.random.Generator) -> bool:
        """Plan from the scene to which the push should lead, unless that is the end."""
        job, plan = decision.job, decision.plan
        if plan is None or decision.failure is not None or not self._planner.config.ahead:
            return False
        expected = replace(job.view, scene=plan.predicted[0], settled=True)
        last = job.task.max_pushes and job.pushes + 1 >= job.task.max_pushes
        if last or replace(job, view=expected).reached:
            return False
        expected_problem = job.problem.after(plan.predicted[0])
        self._planner.prepare(expected_problem, generator, shortest_way(job))
        return True

    def complete(self, decision: PushDecision) -> PushDecision:
        """Return the latest decision with the model's regions, where it has any."""
        scene, plan = decision.job.view.scene, decision.plan
        if plan is None or decision.failure is not None:
            return decision
        plan = self._planner.complete(decision.job.problem, plan)
        if plan.regions is not None:
            self._monitor.expect(scene, plan.predicted[0], plan.regions[0])
        return replace(decision, plan=plan)


def shortest_way(job: PlanJob) -> float:
    """Return the way [m] below which a push would be lost in the noise of the observations."""
    sure = job.view.sure
    return 0.0 if sure is None else SHORTEST * float(sure.places.max())
