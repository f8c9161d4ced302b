"""The agent: what decides, push after push, in the graph, in evaluations and in examples alike."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from sain_core.config import MOST_SEED, Config, live_group, option
from sain_core.errors import CancelledError, ErrorCode, InvalidInputError, OffTableError, SainError
from sain_core.feasibility import Feasibility, Reach
from sain_core.model import RolloutModel
from sain_core.policy import POLICY_HELP
from sain_core.push import push_ids
from sain_core.randomness import generator
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import PushHistory
from sain_core.wire.bodies import check_unchanged
from sain_core.world import PushRecord
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
    PlanJob,
    Prepared,
    PushDecision,
    PushEnded,
    SceneObserved,
    Stop,
    StopReason,
    Task,
    TimePassed,
)
from sain_mppi.agent.goal_tracker import GoalTracker
from sain_mppi.agent.planning import Decider, Patience, PlanningDecider
from sain_mppi.agent.uncertainty import EstimatorConfig
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem

logger = logging.getLogger(__name__)

SERVICE: Final = "service"
IN_PROCESS: Final = "in_process"
MOST_PUSHES: Final = 40  # of an episode; more would tell little and cost time
# The latest, that are kept then: without the oldest one, a model infers anew from all others.
KEPT_PUSHES: Final = 20
MOST_EARLY: Final = 500  # scenes that are kept until their bodies are given
SHORTEST: Final = 4.0  # standard deviations of places: a shorter way of a body is lost in noise
MOST_EPISODES: Final = 16  # others than the present one, whose bodies are kept


@dataclass(frozen=True)
class AgentConfig(Config):
    """How the agent decides, wherever it runs."""

    prior: str = option("planar", "name of the prior that replaces a failed model")
    seed: int = option(
        0, "seed; the same seed and scenes give the same plans", minimum=0, maximum=MOST_SEED
    )
    history: bool = option(True, "infer friction from the earlier pushes of the episode")
    max_refusals: int = option(
        10, "refused pushes from one scene after which the planner stops", minimum=1
    )
    answer_timeout: float = option(
        5.0,
        "time without a result after which a push is planned again",
        unit="s",
        minimum=0.1,
        maximum=3600.0,
    )
    result_patience: float = option(
        0.5,
        "longest wait for the result of the last push before the next plan",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    policy_timeout: float = option(
        2.0, "longest wait for an answer of a policy", unit="s", minimum=0.01, maximum=600.0
    )
    planner: PlannerConfig = live_group(PlannerConfig())
    estimator: EstimatorConfig = EstimatorConfig()
    feasibility: Feasibility = Feasibility()


@dataclass(frozen=True)
class MppiConfig(AgentConfig):
    """What the planner's node plans with."""

    dynamics: str = option(SERVICE, "where the model runs", choices=(SERVICE, IN_PROCESS))
    model: str = option("sain", "model in process: its name, or the path of a checkpoint")
    policy: str = option("", f"in place of the planner, {POLICY_HELP}; empty: none")
    model_timeout: float = option(
        2.0, "longest wait for a reply of the model", unit="s", minimum=0.01, maximum=600.0
    )
    state_file: str = option("", "file to resume from after a crash; empty: none")


class Agent:
    """Brings bodies to one goal after another.

    Events go in, in any order; pushes, stops and computations come out. `update` is quick and
    belongs to one thread. `act` computes at once, others compute on a thread of their own.
    """

    def __init__(
        self, decider: Decider, config: AgentConfig, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.decider = decider
        self.config = config
        self._clock = clock
        patience = config.result_patience
        self._tracker = GoalTracker(config.max_refusals, config.answer_timeout, patience, clock)
        self._exact = config.estimator.is_exact  # scenes: nothing is estimated
        self._estimator = Estimator(config.estimator, patience, clock)
        self._push_ids = push_ids()
        self._episode = 0  # of the latest scene
        self._begun = 0.0  # when the episode of the latest event began [s]
        self._bodies: dict[int, Bodies] = {}  # of this episode and others, by episode
        self._early: list[SceneObserved] = []  # of an episode whose bodies are not given yet
        self._history = 0, PushHistory.empty()  # of an episode
        self._running: PlanJob | None = None
        self._ahead: PlanJob | None = None  # whose push was prepared for last
        self._completing = False  # of the latest decision, whose plan is to be seen first

    @property
    def pushes(self) -> int:
        """Pushes sent for the goal, without refused ones."""
        return self._tracker.pushes

    @property
    def waits_for_rest(self) -> bool:
        """Whether a goal waits for a scene at rest, with no push of its own under way."""
        return self._tracker.waits_for_rest

    @property
    def early(self) -> int:
        """How many scenes wait for the bodies of their episode."""
        return len(self._early)

    def bodies_of(self, episode_id: int) -> Bodies:
        """Return the bodies of an episode, disks if none were given."""
        return self._bodies.get(episode_id, PAPER_DISKS)

    @property
    def bodies(self) -> Bodies:
        """The bodies of the latest scene."""
        return self.bodies_of(self._episode)

    def set_reach(self, reach: Reach) -> None:
        """Plan the next push for an arm that reaches elsewhere."""
        feasibility = replace(self.config.feasibility, reach=reach)
        self.config = replace(self.config, feasibility=feasibility)

    def check(self, event: EpisodeBegun) -> None:
        """Raise `InvalidInputError` where the bodies of the present episode would change."""
        if event.episode_id == self._episode and event.episode_id in self._bodies:
            check_unchanged(self._bodies[event.episode_id], event.bodies)

    def update(self, event: Event) -> tuple[Action, ...]:
        """Take note of an event; return what is to be done, in this order."""
        match event:
            case EpisodeBegun():
                self._begin(event)
            case SceneObserved():
                self._observe(event)
            case PushEnded():
                if event.record is not None and self._exact:
                    self._remember(event.episode_id, event.record)  # else only own, as estimated
                self._end_push(event.push_id, event.code, event.time, event.message)
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
        episode_id, before = event.episode_id, self._begun
        self._begun = event.time
        if episode_id == self._episode and episode_id in self._bodies:
            push_id = self._tracker.awaited_push
            if push_id is not None and not 0.0 < event.time == before:
                self._end_push(push_id, ErrorCode.STALE_SCENE, 0.0)
            return
        self._bodies.pop(episode_id, None)
        others = [other for other in self._bodies if other != self._episode]
        for other in others[: 1 - MOST_EPISODES]:
            del self._bodies[other]
        self._bodies[episode_id] = event.bodies
        early, self._early = self._early, []
        for scene in early:
            self._observe(scene)

    def _set_goal(self, event: GoalGiven) -> tuple[Action, ...]:
        task, observed = event.task, self._tracker.observed
        self._tracker.set_goal(task, event.pushes)
        try:
            self._check_places(task, observed)
        except SainError as error:
            self._tracker.task = None
            return (Stop(task, StopReason.FAILED, error=error),)
        return ()

    def _check_places(self, task: Task, observed: SceneObserved | None) -> None:
        """Check that a goal is on the table, all that needs no scene; one tells what is nearest."""
        try:
            task.goal.check_places(self.config.feasibility.table)
        except OffTableError:
            if observed is not None:
                self._problem(task, observed, observed)
            raise

    def _observe(self, scene: SceneObserved) -> None:
        if scene.bodies_follow and scene.episode_id not in self._bodies:
            same = [early for early in self._early if early.episode_id == scene.episode_id]
            self._early = [*same[1 - MOST_EARLY :], scene]
            return
        self._episode = scene.episode_id
        scene = replace(scene, received=self._clock())
        if self._exact:
            self._tracker.observe(scene)
            return
        self._estimator.observe(scene)
        estimated = self._estimator.estimated  # of this scene, at rest
        settled = estimated is not None and scene.settled  # no push follows while one is under way
        self._tracker.observe(replace(estimated or scene, settled=settled))

    def _remember(self, episode_id: int, push: PushRecord) -> None:
        if not self.config.history:
            return
        latest, history = self._history
        if latest != episode_id:
            history = PushHistory.empty(len(push.before))
        try:
            history = history.then(push.before, push.push, push.after, push.noise)
        except InvalidInputError as error:
            logger.warning("a push is left out of the history: %s", error)
            return
        full = len(history) >= MOST_PUSHES
        self._history = episode_id, history.latest(KEPT_PUSHES) if full else history

    def _end_push(self, push_id: int, code: int, time: float, why: str = "") -> None:
        self._estimator.ended(push_id, code, time)
        self._tracker.ended(push_id, code, why)

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
        task, observed = self._tracker.task, self._tracker.next_scene()
        if task is None or observed is None:
            return ()
        try:
            job = self._job(task, observed)
        except SainError as error:
            return (Stop(task, StopReason.FAILED, error=error),)
        if stop := self._tracker.stop(job):
            if stop.reason is StopReason.REACHED:  # it is over, also if bodies are moved later
                self._tracker.task = None
            return (stop,)
        self._running = job
        failed = partial(Stop, task, StopReason.FAILED, job)
        return (Computation(partial(self._decide, job), lambda error: Decided(failed(error))),)

    def _job(self, task: Task, observed: SceneObserved) -> PlanJob:
        """Return the job of deciding on a scene; scene and goal are checked here, once."""
        tracker, count = self._tracker, len(observed.scene)
        assert tracker.start is not None
        problem = replace(self._problem(task, observed, tracker.start), refused=tracker.refused)
        if (uncertainty := observed.uncertainty) is not None:
            uncertainty.check_tolerance(problem.goal)
            problem = replace(problem, shortest=SHORTEST * float(uncertainty.places.max()))
        episode_id, history = self._history
        if episode_id != observed.episode_id or history.disks != count:
            history = PushHistory.empty(count)
        if len(history):
            before = replace(problem, scene=history.state[-1])
            problem = replace(problem, tool=before.tool_after(history.action[-1]))
        return PlanJob(task, observed, problem, tracker.session, tracker.pushes, history)

    def _problem(self, task: Task, observed: SceneObserved, start: SceneObserved) -> Problem:
        """Return what a goal asks for in a scene; scene and goal are checked."""
        goal, bodies = task.goal.fitted(len(observed.scene)), self.bodies_of(observed.episode_id)
        return Problem.of(observed.scene, goal, bodies, start.scene, self.config.feasibility)

    def _take_estimate(self) -> None:
        """Take the scene that frames at rest show, once there are enough of them."""
        estimated = self._estimator.estimate(self.bodies_of)
        if estimated is None:
            return
        if self._estimator.executed is not None:
            self._remember(estimated.episode_id, self._estimator.executed)
        self._tracker.observe(estimated)

    def _decide(self, job: PlanJob) -> Decided:
        try:
            random = generator(self.config.seed, "plan", *job.stream)
            decision = self.decider.decide(job, random)
            limits = self.config.feasibility.limits
            limits.check(decision.push, job.problem.bodies)  # nothing else is ever sent
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
        self._estimator.sent(sent)
        self._ahead, self._completing = job, True
        return (
            sent,
            Computation(partial(self._complete, sent), lambda error: Completed(sent)),
            Computation(partial(self._prepare, sent), lambda error: Prepared()),
        )

    def _complete(self, decision: PushDecision) -> Completed:
        return Completed(self._estimator.completed(self.decider.complete(decision)))

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
    return Agent(PlanningDecider(model, physics, config.planner, patience), config)
