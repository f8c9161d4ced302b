"""The agent: what decides, push after push, in the graph, in evaluations and in examples alike."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

from sain_core.config import Config, live_group, option
from sain_core.errors import CancelledError, ErrorCode, InvalidInputError, SainError
from sain_core.feasibility import Feasibility
from sain_core.model import RolloutModel
from sain_core.push import push_ids
from sain_core.seeding import generator
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scalars, Scene
from sain_mppi.agent.decision import Decider, PlanJob, PushDecision, Stop, StopReason, View
from sain_mppi.agent.estimate import EstimatorConfig
from sain_mppi.agent.estimator import Estimator
from sain_mppi.agent.events import (
    Action,
    Completed,
    Computation,
    Decided,
    EpisodeBegun,
    Event,
    GoalCancelled,
    GoalGiven,
    Prepared,
    PushEnded,
    PushExecuted,
    SceneSeen,
    TimePassed,
)
from sain_mppi.agent.fallback import Patience
from sain_mppi.agent.goal_tracker import GoalTracker, GoalTrackerConfig
from sain_mppi.agent.memory import EpisodeMemory
from sain_mppi.agent.planning import PlanningDecider
from sain_mppi.algorithms.config import PlannerConfig

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

    Events go in, in any order; pushes, stops and computations come out. `update` is quick and
    belongs to one thread. `act` computes at once, others compute on a thread of their own.
    """

    def __init__(
        self,
        decider: Decider,
        config: AgentConfig,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Let this decider choose the pushes. Begin without a goal and without a scene."""
        self.decider = decider
        self.config = config
        self._clock = clock
        self._tracker = GoalTracker(config.goal_tracker, config.feasibility.table, clock)
        self._memory = EpisodeMemory()
        patience = config.goal_tracker.result_patience
        self._estimator: Estimator | None = None  # exact scenes need none
        if not config.estimator.is_exact:
            limits = config.feasibility.limits
            self._estimator = Estimator(config.estimator, patience, clock, limits)
        self._push_ids = push_ids()
        self._episode: EpisodeBegun | None = None
        self._running: PlanJob | None = None
        self._ahead: PlanJob | None = None  # whose push was prepared for last
        self._completing = False  # of the latest decision, whose plan is to be seen first

    @property
    def pushes(self) -> int:
        """Pushes sent for the goal, without refused ones."""
        return self._tracker.pushes

    def update(self, event: Event) -> tuple[Action, ...]:
        """Take note of an event; return what is to be done, in this order."""
        match event:
            case EpisodeBegun():
                self._begin(event)
            case SceneSeen():
                self._see(event)
            case PushExecuted():
                self._learn(event)
                self._end_push(event.push_id, ErrorCode.OK, event.time)
            case PushEnded():
                self._end_push(event.push_id, event.code, event.time)
            case GoalGiven():
                return (*self._set_goal(event), *self._next())
            case GoalCancelled():
                return self._cancel(event)
            case Decided():
                return (*self._conclude(event.outcome), *self._next())
            case Completed():
                self._completing = False
            case Prepared() | TimePassed():
                pass
        return self._next()

    def _begin(self, event: EpisodeBegun) -> None:
        before, self._episode = self._episode, event
        again = before is not None and before.episode_id == event.episode_id
        if again and (push_id := self._tracker.awaited_push) is not None:
            self._end_push(push_id, ErrorCode.STALE_SCENE, event.time)

    def _set_goal(self, event: GoalGiven) -> tuple[Action, ...]:
        try:
            self._tracker.aim(event.task, event.pushes)
        except SainError as error:
            return (Stop(event.task, StopReason.FAILED, error=error),)
        return ()

    def _see(self, event: SceneSeen) -> None:
        settled, now = event.settled, self._clock()
        view = View(event.scene, event.episode_id, event.scene_id, settled, now, event.time)
        if self._estimator is None:
            self._tracker.see(view)
            return
        self._estimator.see(view)
        known = self._estimator.view  # of this scene, at rest
        settled = known is not None and settled  # no push follows while one is under way
        self._tracker.see(replace(known or view, settled=settled))

    def _learn(self, event: PushExecuted) -> None:
        """Remember a push; where observations are not exact, only own ones, as estimated."""
        if self._estimator is None:
            self._remember(event.episode_id, event.before, event.push, event.after)

    def _remember(
        self,
        episode_id: int,
        before: Scene,
        push: PushArray,
        after: Scene,
        noise: Scalars | None = None,
    ) -> None:
        if not self.config.history:
            return
        try:
            self._memory.add(episode_id, before, push, after, noise)
        except InvalidInputError as error:
            logger.warning("nothing is learned of a push: %s", error)

    def _end_push(self, push_id: int, code: int, time: float) -> None:
        if self._estimator is not None:
            self._estimator.answered(push_id, code, time)
        self._tracker.answered(push_id, code)

    def _cancel(self, event: GoalCancelled) -> tuple[Action, ...]:
        task, self._tracker.task = self._tracker.task, None
        for job in (self._running, self._ahead):
            if job is not None:
                job.cancelled.set()
        return () if task is None else (Stop(task, StopReason.FAILED, error=event.error),)

    def _next(self) -> tuple[Action, ...]:
        """Return what follows from all events so far.

        While a job is being decided, nothing does. It is cancelled once its goal or scene is past.
        """
        if self._running is not None:
            if not self._tracker.is_current(self._running):
                self._running.cancelled.set()
            return ()
        if self._completing:
            return ()
        self._take_estimate()
        job = self._tracker.next_job()
        if job is None:
            return ()
        episode_id = job.view.episode_id
        past = self._memory.of(episode_id, len(job.view.scene))
        if self._estimator is not None:
            past = self._estimator.retold(past)
        job = replace(job, bodies=self._bodies_of(episode_id), history=past)
        try:
            job.check()
        except SainError as error:
            return (Stop(job.task, StopReason.FAILED, error=error),)
        if stop := self._tracker.stop(job):
            return (stop,)
        self._running = job
        failed = partial(Stop, job.task, StopReason.FAILED, job)
        return (Computation(partial(self._decide, job), lambda error: Decided(failed(error))),)

    def _bodies_of(self, episode_id: int) -> Bodies:
        begun = self._episode
        return begun.bodies if begun and begun.episode_id == episode_id else PAPER_DISKS

    def _take_estimate(self) -> None:
        """Take the scene that frames at rest show, once there are enough of them."""
        estimator = self._estimator
        view = None if estimator is None else estimator.estimate(self._bodies_of)
        if estimator is None or view is None:
            return
        if (made := estimator.pushed) is not None:
            self._remember(view.episode_id, made.before, made.push, made.after, made.noise)
        self._tracker.see(view)

    def _decide(self, job: PlanJob) -> Decided:
        try:
            random = generator(self.config.seed, "plan", *job.stream)
            decision = self.decider.decide(job, random)
            limits = self.config.feasibility.limits
            limits.check(decision.push, job.known_bodies)  # nothing else is ever sent
        except CancelledError:
            return Decided(None)
        except SainError as error:
            return Decided(Stop(job.task, StopReason.FAILED, job, error))
        return Decided(decision)

    def _conclude(self, outcome: PushDecision | Stop | None) -> tuple[Action, ...]:
        """End the running job; return its outcome if it is still wanted, with the push counted."""
        job, self._running = self._running, None
        if outcome is None or job is None or not self._tracker.is_current(job):
            return ()
        if isinstance(outcome, Stop):
            return (outcome,)
        sent = replace(outcome, push_id=next(self._push_ids))
        self._tracker.sent(sent.push_id, sent.push)
        if self._estimator is not None:
            self._estimator.sent(sent)
        self._ahead, self._completing = job, True
        return (
            sent,
            Computation(partial(self._complete, sent), lambda error: Completed(sent)),
            Computation(partial(self._prepare, sent), lambda error: Prepared()),
        )

    def _complete(self, decision: PushDecision) -> Completed:
        completed = self.decider.complete(decision)
        estimator = self._estimator
        return Completed(completed if estimator is None else estimator.completed(completed))

    def _prepare(self, decision: PushDecision) -> Prepared:
        """Work ahead. The same work in the same order gives the same pushes."""
        random = generator(self.config.seed, "ahead", *decision.job.stream)
        with suppress(CancelledError):
            self.decider.prepare(decision, random)
        return Prepared()


def act(agent: Agent, *events: Event) -> PushDecision | Stop | None:
    """Hand events to an agent and do its work at once; return what it decides. None: it waits."""
    decided = [action for event in events for action in _done(agent, event)]
    return decided[-1] if decided else None


def _done(agent: Agent, event: Event) -> Iterator[PushDecision | Stop]:
    for action in agent.update(event):
        if isinstance(action, Computation):
            yield from _done(agent, action.run())
        else:
            yield action


def planning_agent(
    model: RolloutModel,
    physics: RolloutModel,
    config: AgentConfig,
    patience: Patience | None = None,
) -> Agent:
    """Return an agent that plans with a model, and with physics while the model fails.

    `patience` is the model's, where it may have to be waited for.
    """
    decider = PlanningDecider(model, physics, config.planner, config.feasibility, patience)
    return Agent(decider, config)
