"""The agent: what decides, push after push, in the graph, in evaluations and in examples alike."""

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from sain_core.config import Config, live_group, option
from sain_core.dynamics import RolloutModel
from sain_core.errors import CancelledError, ErrorCode, InvalidInputError, SainError
from sain_core.feasibility import Feasibility
from sain_core.push import push_ids
from sain_core.scene import check_on_table
from sain_core.seeding import generator
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene
from sain_mppi.loop.decision import Decider, PlanJob, PushDecision, Stop, StopReason, Task, View
from sain_mppi.loop.estimate import EstimatorConfig
from sain_mppi.loop.estimator import Estimator
from sain_mppi.loop.goal_tracker import GoalTracker, GoalTrackerConfig
from sain_mppi.loop.memory import EpisodeMemory
from sain_mppi.loop.planning import PlanningDecider
from sain_mppi.search.config import PlannerConfig

logger = logging.getLogger(__name__)

SERVICE = "service"
IN_PROCESS = "in_process"


@dataclass(frozen=True)
class AgentConfig(Config):
    """How the agent decides, wherever it runs."""

    prior: str = option("planar", "name of the prior that replaces a failed model")
    seed: int = option(0, "seed; the same seed and scenes give the same plans", minimum=0)
    history: bool = option(True, "infer friction from the earlier pushes of the episode")
    planner: PlannerConfig = live_group(PlannerConfig())
    goal_tracker: GoalTrackerConfig = GoalTrackerConfig()
    estimator: EstimatorConfig = EstimatorConfig()
    feasibility: Feasibility = Feasibility()


@dataclass(frozen=True)
class MppiConfig(AgentConfig):
    """What the planner's node plans with."""

    dynamics: str = option(SERVICE, "where the model runs", choices=(SERVICE, IN_PROCESS))
    model: str = option("sain", "model in process: its name, or the path of a checkpoint")
    model_timeout: float = option(
        2.0, "longest wait for a reply of the model", unit="s", minimum=0.01, maximum=600.0
    )
    state_file: str = option(
        "", "file that is kept to go on from after a crash, and gone on from; empty: none"
    )


class Agent:
    """Brings the target to one goal after another.

    Goals, scenes and results go in; pushes and stops come out. `act` does a whole decision. A
    caller that must not wait calls `next`, has `decide` and `complete` run on a worker thread, and
    hands the decision to `conclude`. All other methods belong to the caller's own thread.
    """

    def __init__(
        self,
        decider: Decider,
        config: AgentConfig,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Let this decider choose the pushes. Begin without a goal and without a scene."""
        self.decider = decider
        self._config = config
        self._clock = clock
        self._tracker = GoalTracker(config.goal_tracker, config.feasibility.table, clock)
        self._memory = EpisodeMemory()
        patience = config.goal_tracker.result_patience
        self._estimator: Estimator | None = None  # exact scenes need none
        if not config.estimator.is_exact:
            limits = config.feasibility.limits
            self._estimator = Estimator(config.estimator, patience, clock, limits)
        self._push_ids = push_ids()
        self._bodies: tuple[int, Bodies] = (0, PAPER_DISKS)  # of which episode
        self._running: PlanJob | None = None
        self._ahead: PlanJob | None = None  # whose push was prepared for last

    @property
    def pushes(self) -> int:
        """Pushes sent for the goal, without refused ones."""
        return self._tracker.pushes

    def aim(self, task: Task, pushes: int = 0) -> Stop | None:
        """Follow a new goal, for which so many pushes were sent; return why not, if it fails."""
        try:
            self._tracker.aim(task, pushes)
        except SainError as error:
            return Stop(task, StopReason.FAILED, error=error)
        return None

    def drop(self) -> Task | None:
        """Follow no goal any more; return the one that was followed."""
        task, self._tracker.task = self._tracker.task, None
        return task

    def see(
        self, scene: Scene, episode_id: int, scene_id: int, settled: bool, observed: float = 0.0
    ) -> None:
        """Take note of a scene (N, 8), with the ids by which a push names it.

        `observed` is the time [s] of the observation, by the clock of the results.
        """
        view = View(scene, episode_id, scene_id, settled, self._clock(), observed)
        if self._estimator is None:
            self._tracker.see(view)
            return
        self._estimator.see(view)
        known = self._estimator.view  # of this scene, at rest
        settled = known is not None and settled  # no push follows while one is under way
        self._tracker.see(replace(known or view, settled=settled))

    def meet(self, episode_id: int, bodies: Bodies) -> None:
        """Take note of the shapes and roles of an episode's bodies; without them, all are disks."""
        self._bodies = (episode_id, bodies)

    def learn(self, episode_id: int, scene: Scene, push: PushArray, next_scene: Scene) -> None:
        """Take note that a push (3,), whoever sent it, led from one scene (N, 8) to another.

        Raises:
            InvalidInputError: it cannot be; nothing is learned from it.

        Where observations are not exact, only own pushes count, with the estimated scenes.
        """
        if self._config.history and self._estimator is None:
            self._memory.add(episode_id, scene, push, next_scene)

    def answered(self, push_id: int, code: int, time: float = 0.0) -> bool:
        """Take note that a push was executed (OK) or refused; tell if an own one was refused.

        `time` is when it ended [s], by the clock of the observations. Call `learn` first, so that
        the next plan includes the push.
        """
        if self._estimator is not None:
            self._estimator.answered(push_id, code, time)
        return self._tracker.answered(push_id, code)

    def world_restarted(self, time: float) -> None:
        """Take note [s] that who executes pushes began anew: the push under way has no result."""
        if (push_id := self._tracker.awaited_push) is not None:
            self.answered(push_id, ErrorCode.STALE_SCENE, time)

    def next(self) -> PlanJob | Stop | None:
        """Return what is to be decided now, or why no push follows; None: there is nothing to do.

        While a job is being decided, there is nothing else to do. It is cancelled here once its
        goal or scene is past.
        """
        if self._running is not None:
            if not self._tracker.is_current(self._running):
                self._running.cancelled.set()
            return None
        self._take_estimate()
        job = self._tracker.next_job()
        if job is None:
            return None
        episode, bodies = self._bodies
        if episode == job.view.episode_id:
            job = replace(job, bodies=bodies)
        try:
            job.check(self._config.feasibility.table)
        except SainError as error:
            return Stop(job.task, StopReason.FAILED, error=error)
        if stop := self._tracker.stop(job):
            return stop
        past = self._memory.of(job.view.episode_id, len(job.view.scene))
        if self._estimator is not None:
            past = self._estimator.retold(past)
        self._running = replace(job, history=past)
        return self._running

    def _take_estimate(self) -> None:
        """Take the scene that frames at rest show, once there are enough of them."""
        estimator = self._estimator
        episode, bodies = self._bodies
        view = None if estimator is None else estimator.estimate(episode, bodies)
        if estimator is None or view is None:
            return
        if (made := estimator.pushed) is not None and self._config.history:
            try:
                self._memory.add(view.episode_id, made.before, made.push, made.after, made.noise)
            except InvalidInputError as error:
                logger.warning("nothing is learned of a push: %s", error)
        self._tracker.see(view)

    def decide(self, job: PlanJob) -> PushDecision | Stop | None:
        """Decide on a job; None: it was cancelled. May take long."""
        try:
            check_on_table(job.view.scene, self._config.feasibility.table)
            random = generator(self._config.seed, "plan", *job.stream)
            decision = self.decider.decide(job, random)
            self._config.feasibility.limits.check(decision.push)  # nothing else is ever sent
        except CancelledError:
            return None
        except SainError as error:
            return Stop(job.task, StopReason.FAILED, job, error)
        return decision

    def conclude(self, decision: PushDecision | Stop | None) -> PushDecision | Stop | None:
        """End the running job; return its decision, with the push counted as sent.

        None: it is no longer wanted, and there is nothing to send.
        """
        job, self._running = self._running, None
        if decision is None or job is None or not self._tracker.is_current(job):
            return None
        if isinstance(decision, PushDecision):
            decision = replace(decision, push_id=next(self._push_ids))
            self._tracker.sent(decision.push_id, decision.push)
            if self._estimator is not None:
                self._estimator.sent(decision)
        return decision

    def complete(self, decision: PushDecision) -> PushDecision:
        """Return the latest decision with what its push need not wait for. May take long."""
        completed = self.decider.complete(decision)
        return completed if self._estimator is None else self._estimator.completed(completed)

    def prepare(self, decision: PushDecision) -> None:
        """Work ahead while the push of the latest decision is executed. May take long.

        Call it after `complete`, before the next scene is decided on. The same calls in the same
        order give the same pushes.
        """
        self._ahead = decision.job
        random = generator(self._config.seed, "ahead", *decision.job.stream)
        with suppress(CancelledError):
            self.decider.prepare(decision, random)

    def act(self) -> PushDecision | Stop | None:
        """Decide what is to be decided now, all at once; None: there is nothing to do."""
        job = self.next()
        if not isinstance(job, PlanJob):
            return job
        decision = self.conclude(self.decide(job))
        if not isinstance(decision, PushDecision):
            return decision
        decision = self.complete(decision)
        self.prepare(decision)
        return decision

    def cancel(self) -> None:
        """Let the running job end soon. For any thread."""
        for job in (self._running, self._ahead):
            if job is not None:
                job.cancelled.set()


def planning_agent(model: RolloutModel, physics: RolloutModel, config: AgentConfig) -> Agent:
    """Return an agent that plans with a model, and with physics while the model fails."""
    decider = PlanningDecider(model, physics, config.planner, config.feasibility)
    return Agent(decider, config)
