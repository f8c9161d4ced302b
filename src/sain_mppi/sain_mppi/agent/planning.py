"""From a job to a push: the planner, its model, the physics behind it, and the progress."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from threading import Event
from time import monotonic
from typing import Final, Self

import numpy as np

from sain_core.errors import CancelledError, ConfigError, NoProgressError, SainError
from sain_core.model import Radii, RolloutModel, check_rollout
from sain_core.scene import POSITION, TARGET
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, PushSequences, Scalars, Scene
from sain_mppi.agent.dead_end import Cause, DeadEnd, find_dead_end
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.algorithms.sampling import WarmStart
from sain_mppi.algorithms.search import RESET
from sain_mppi.config import PlannerConfig, ProgressConfig
from sain_mppi.objective.cost import Objective
from sain_mppi.planner import Planner

logger = logging.getLogger(__name__)

NOISE: Final = 3.0  # standard deviations of places: by so much more may an error seem to be
MODEL_SHARE: Final = 0.8  # of the time for a plan: a model that is silent so long is late
TOLERATED: Final = 0.01  # [m], error of a prediction
TOLERATED_SHARE: Final = 0.3  # likewise, of the predicted way, if that is more
NEARER: Final = 0.99  # of the best so far: a resting cost below this share is progress
MUCH: Final = 0.9  # of the resting cost at the last such progress: below, a body came nearer


class Decider(ABC):
    """Chooses the push for one job after another. All but `adjust` belong to one thread.

    Attributes:
        trouble: what is wrong while it decides, to be reported meanwhile; empty: nothing.
    """

    trouble: str = ""

    @abstractmethod
    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Choose a push; the same jobs and generators give the same pushes.

        Raises `CancelledError`: the job was cancelled; `SainError`: there is no push to make, and
        why.
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

    @property
    def figures(self) -> Mapping[str, object]:
        """What diagnostics show of it."""
        return {}

    def adjust(self, planner: PlannerConfig) -> None:
        """Plan with other settings from the next job on; raise `ConfigError` if it has none."""
        raise ConfigError(f"{type(self).__name__} does not plan: it has no settings to change")


@dataclass
class Patience:
    """How long a plan waits for its model; shared with a model that answers from elsewhere."""

    # a model that has not answered by this `time.monotonic` fails; None: no limit
    until: float | None = None
    # once it is set, the plan ends with `CancelledError`
    cancelled: Event = field(default_factory=Event)


class PlanningDecider(Decider):
    """Plans with a model, with physics while the model fails, and wider after large errors.

    What earlier pushes show is inferred beside the arm's motion. A prepared plan is corrected with
    what was inferred then: the latest push, which led about where it should, counts from the next
    plan on; so does it where the next goal comes. A surprise counts at once, and so does an
    episode's first push.
    """

    def __init__(
        self,
        model: RolloutModel,
        physics: RolloutModel,
        config: PlannerConfig,
        patience: Patience | None = None,
    ) -> None:
        self._model, self._physics = model, physics
        self._patience = patience or Patience()
        self._monitor = ProgressMonitor(config.progress)
        self._config = config
        self._session: int | None = None
        self._planner = Planner(model, config)  # of the latest job
        self._rest = WarmStart()  # what its plan leaves
        self._inferred: PushHistory | None = None  # from what the model was inferred for it

    def adjust(self, planner: PlannerConfig) -> None:
        """Plan with other settings from the next job on."""
        self._config = planner

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Plan from the job's scene and take the first push.

        Raises `CancelledError`: the job was cancelled; `NoPushError` or `NoProgressError`: there is
        no push to make; `SainError`: model and physics failed.
        """
        config, monitor = self._config, self._monitor
        started, time = monotonic(), config.deadline
        is_new = job.session != self._session
        if is_new:
            monitor.reset()
            self._session, self._rest = job.session, WarmStart()
        monitor.config = config.progress
        self._patience.until = started + MODEL_SHARE * time if time else None
        self._patience.cancelled = job.cancelled
        self._compare(job)
        warning, dead_end = monitor.warning, self._dead_end(job)
        if dead_end is not None and dead_end.cause is Cause.UNEXPLAINED:
            # A way round, on which another body is moved first, looks the same for some pushes.
            is_sure = warning or monitor.stalled >= 2 * config.progress.stalled_after
            dead_end = dead_end if is_sure else None
        if warning or config != self._planner.config:
            self._rest = replace(self._rest, prepared=None)
        prepared = self._rest.prepared_for(job.problem.goal, bool(job.problem.refused))
        later = self._inferred and (prepared is not None or (is_new and self._continues(job)))
        history = self._inferred if later else job.history
        model = self._following(history, job.problem.bodies)
        planner = self._planner = Planner(model, config, monitor.careful)
        if warning:
            planner = replace(planner, config=config.widened())
        deadline = started + time if time else None
        plan = planner.plan(job.problem, generator, self._rest, deadline)
        self._rest = plan.rest
        monitor.expect(job.problem.scene, plan.predicted[0])
        self._inferred = history
        errors = monitor.errors, monitor.expected
        decision = PushDecision(job, plan.push, plan, model.failure, warning, *errors)
        return replace(decision, settings=config, dead_end=dead_end)

    def _following(self, history: PushHistory | None, bodies: Bodies) -> "FallbackRollout":
        """Return the model after a history, with physics behind it."""
        return FallbackRollout(self._model, self._physics, history, bodies, self._patience)

    def _continues(self, job: PlanJob) -> bool:
        """Return whether at most one push was made since the model was inferred."""
        assert self._inferred is not None
        earlier = self._inferred.action
        is_recent = 0 <= len(job.history) - len(earlier) <= 1
        return is_recent and np.array_equal(job.history.action[: len(earlier)], earlier)

    def _infer(self, job: PlanJob) -> None:
        """Have the planner's model follow all pushes before a job, where it does not yet."""
        if self._inferred is not job.history:
            model = self._following(job.history, job.problem.bodies)
            self._planner, self._inferred = replace(self._planner, model=model), job.history

    def _compare(self, job: PlanJob) -> None:
        """Compare the scene with what was expected; raise when it is no use going on."""
        monitor, uncertainty = self._monitor, job.observed.uncertainty
        rest_cost = Objective(job.problem, self._config.weights).rest_cost()
        noise = None if uncertainty is None else NOISE * uncertainty.places
        monitor.observe(job.problem.scene, rest_cost, noise)
        if monitor.hopeless:
            raise NoProgressError(
                f"{self._dead_end(job)}; the distance is {1e3 * job.judgement.distance:.0f} mm:"
                f" send the goal again, or {RESET}"
            )

    def _dead_end(self, job: PlanJob) -> DeadEnd | None:
        """Return why pushes bring a body no nearer; None: they do."""
        monitor = self._monitor
        if monitor.stalled < self._config.progress.stalled_after:
            return None
        return find_dead_end(job.problem, monitor.stalled, monitor.mean_errors)

    def prepare(self, decision: PushDecision, generator: np.random.Generator) -> bool:
        """Plan from the scene to which the push should lead, unless that is the end."""
        job, plan = decision.job, decision.plan
        if plan is None or decision.failure is not None or not self._planner.config.ahead:
            return False
        expected = replace(job.observed, scene=plan.predicted[0], settled=True)
        last = job.task.max_pushes and job.pushes + 1 >= job.task.max_pushes
        if last or replace(job, observed=expected).reached:
            return False
        self._infer(job)
        expected_problem = replace(
            job.problem, scene=plan.predicted[0], tool=job.problem.tool_after(plan.push), refused=()
        )
        self._rest = self._planner.prepare(expected_problem, generator, self._rest)
        return True

    def complete(self, decision: PushDecision) -> PushDecision:
        """Return the latest decision with the model's regions, where it has any."""
        plan = decision.plan
        if plan is None or decision.failure is not None:
            return decision
        problem = decision.job.problem
        self._infer(decision.job)
        plan = self._planner.complete(problem, plan)
        if plan.regions is not None:
            self._monitor.expect(problem.scene, plan.predicted[0], plan.regions[0])
        return replace(decision, plan=plan)


class FallbackRollout:
    """Predicts with a model; once it fails, with physics. Made anew for each plan.

    A model fails when it raises, is late (it raises then), predicts NaN or Inf, or predicts for
    another scene. Within one plan there is no way back: a silent model delays a plan only once.
    """

    def __init__(
        self,
        model: RolloutModel,
        physics: RolloutModel,
        history: PushHistory | None = None,
        bodies: Bodies = PAPER_DISKS,
        patience: Patience | None = None,
    ) -> None:
        """Ask this model, or else this physics.

        Physics is conditioned when it is first used: inferring a friction takes time.

        Args:
            model: to ask first.
            physics: to fall back on.
            history: the episode's earlier pushes, on which both are conditioned.
            bodies: shapes and roles.
            patience: with the model.
        """
        self._models, self._history, self._bodies = (model, physics), history, bodies
        self._patience = patience or Patience()
        self._physics: RolloutModel | None = None  # conditioned
        self.failure: SainError | None = None
        try:
            self._model = self._conditioned(model)
        except ConfigError as error:  # it cannot predict such bodies
            self.failure = error

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same for these bodies, where the model has not failed yet."""
        return type(self)(*self._models, self._history, bodies, self._patience)

    def condition(self, history: PushHistory) -> Self:
        """Return the same conditioned on a history, where the model has not failed yet."""
        return type(self)(*self._models, history, self._bodies, self._patience)

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, A) from one scene (N, 8)."""
        if self._patience.cancelled.is_set():
            raise CancelledError("the plan is no longer wanted")
        if self.failure is None:
            try:
                return check_rollout(self._model.rollout(scene, pushes), scene, pushes)
            except CancelledError:
                raise
            except SainError as error:
                logger.debug("falling back to physics: %s", error)
                self.failure = error
        if self._physics is None:
            self._physics = self._conditioned(self._models[1])
        return self._physics.rollout(scene, pushes)

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the model's regions of what it predicted; None: it, or physics, has none."""
        if self.failure is not None:
            return None
        try:
            return self._model.regions(scene, pushes, predicted)
        except SainError as error:  # the plan stands without it
            logger.debug("no regions are known: %s", error)
            return None

    def _conditioned(self, model: RolloutModel) -> RolloutModel:
        model = model.with_bodies(self._bodies)
        return model if self._history is None else model.condition(self._history)


class ProgressMonitor:
    """Follows one goal: compares each scene with the predicted one and with the best so far.

    Attributes:
        config: what it judges by.
        without: pushes in a row without progress.
        stalled: pushes in a row without much progress: nudges that hardly change anything count.
        errors: (N,) [m], of the last planned push, from the predicted place to the observed one;
            None: there was none.
        expected: (N,) [m], errors up to these are expected.
    """

    def __init__(self, config: ProgressConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget how pushes came out."""
        self._before: Scene | None = None
        self._predicted: Scene | None = None
        self._regions: Scalars | None = None
        self._best = self._reference = np.inf
        self.without = self.stalled = 0
        self.errors: Scalars | None = None
        self.expected: Scalars | None = None
        self._errors: list[Scalars] = []  # (N,) [m], of each push

    def expect(self, scene: Scene, predicted: Scene, regions: Scalars | None = None) -> None:
        """Take note of the scene (N, 8) to which a push from another scene (N, 8) should lead.

        `regions` (N,) [m] are the radii of the regions that should hold the disks, if the model has
        them. An error inside its region does not trigger wider planning.
        """
        self._before, self._predicted, self._regions = scene.copy(), predicted.copy(), regions

    def observe(self, scene: Scene, rest_cost: float, noise: Scalars | None = None) -> None:
        """Take note of the present scene (N, 8), and of what it would cost to do nothing.

        `noise` (N,) [m] is by how much more places may seem to differ from what was expected.
        """
        self.errors = self.expected = None
        before, predicted = self._before, self._predicted
        if before is not None and predicted is not None and not np.array_equal(scene, before):
            if scene.shape == predicted.shape:
                self._compare(before, predicted, scene, noise)
            self.without += 1
            self.stalled += 1
        if rest_cost < MUCH * self._reference:
            self.stalled, self._reference = 0, rest_cost
        if rest_cost < NEARER * self._best:
            self.without, self._best = 0, rest_cost

    def _compare(
        self, before: Scene, predicted: Scene, scene: Scene, noise: Scalars | None
    ) -> None:
        self.errors = np.linalg.norm((scene - predicted)[:, POSITION], axis=1)
        self._errors.append(self.errors)
        way = np.linalg.norm((predicted - before)[:, POSITION], axis=1)
        self.expected = np.maximum(TOLERATED, TOLERATED_SHARE * way)
        if self._regions is not None:
            self.expected = np.maximum(self.expected, self._regions)
        if noise is not None:
            self.expected = np.hypot(self.expected, noise)

    @property
    def warning(self) -> str:
        """Why to plan wider than by default; empty: there is no reason to."""
        if self.errors is not None and self.expected is not None:
            errors, expected = self.errors[: TARGET + 1], self.expected[: TARGET + 1]
            worst = int(np.argmax(errors / expected))
            if errors[worst] > expected[worst]:
                return (
                    f"{('mid disk', 'target')[worst]} {1e3 * errors[worst]:.0f} mm from where it"
                    f" should be, {1e3 * expected[worst]:.0f} mm were expected"
                )
        if self.without >= self.config.stalled_after:
            return f"{self.without} pushes brought nothing"
        return ""

    @property
    def careful(self) -> bool:
        """Whether pushes near the goal should be slow: all but the first push."""
        return bool(self._errors)

    @property
    def mean_errors(self) -> Scalars | None:
        """The mean error (N,) [m] of each body's predicted places; None: there is none."""
        return np.mean(self._errors, axis=0) if self._errors else None

    @property
    def hopeless(self) -> bool:
        """Whether there is no point in going on."""
        most = self.config.give_up_after
        return most > 0 and self.stalled >= most
