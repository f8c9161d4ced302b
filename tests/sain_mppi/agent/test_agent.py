"""The agent, without ROS: what goes in and what comes out."""

from dataclasses import replace
from threading import Event, Thread

import numpy as np
import pytest

from sain_core.errors import ErrorCode
from sain_core.goal import Goal
from sain_core.model import IdentityPrior
from sain_core.push import make_push
from sain_core.scene import POSITION, TARGET
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.transitions import PushHistory
from sain_core.world import PushRecord
from sain_mppi.agent.agent import (
    KEPT_PUSHES,
    MOST_PUSHES,
    Agent,
    AgentConfig,
    act,
    planning_agent,
)
from sain_mppi.agent.events import (
    Computation,
    EpisodeBegun,
    GoalCancelled,
    GoalGiven,
    PushDecision,
    PushEnded,
    SceneObserved,
    Stop,
    StopReason,
    Task,
    TimePassed,
)
from sain_mppi.agent.planning import Decider, PlanningDecider
from sain_mppi.config import PlannerConfig

CONFIG = AgentConfig(planner=PlannerConfig(samples=32, rounds=2, horizon=2))
PLACE = np.array([0.70, 0.05])
TASK = Task(1, 0, Goal.place(*PLACE, 0.01), 0)
PUSH = make_push(0.0, 0.1, 0.05)
SOMEBODY = 9  # else's push


class Still(IdentityPrior):
    """Predicts that nothing moves, and keeps how many earlier pushes it was conditioned on."""

    def __init__(self):
        self.conditioned = []

    def condition(self, history: PushHistory) -> "Still":
        self.conditioned.append(len(history))
        return self

    def rollout(self, scene, pushes):
        return np.broadcast_to(scene, (*pushes.shape[:2], *scene.shape)).copy()


class Fixed(Decider):
    """Wants the same push whatever happens."""

    def __init__(self, push):
        self.push = make_push(*push)

    def decide(self, job, generator):
        return PushDecision(job, self.push)


@pytest.fixture
def agent(dynamics):
    return planning_agent(dynamics, dynamics, CONFIG)


def begun(agent, scene, task=TASK):
    """Return what an agent decides on a goal and a first scene."""
    return act(agent, GoalGiven(task), SceneObserved(scene, 1, 1))


def pushed(decision) -> PushDecision:
    assert isinstance(decision, PushDecision), decision
    return decision


def executed(push_id, push, before, after) -> PushEnded:
    return PushEnded(push_id, record=PushRecord(push, before, after), episode_id=1)


def stopped(decision) -> Stop:
    assert isinstance(decision, Stop), decision
    return decision


def test_it_brings_the_target_to_the_goal_and_stops(agent, scene, dynamics):
    act(agent, GoalGiven(TASK))
    for number in range(1, 10):
        decision = act(agent, SceneObserved(scene, 1, number))
        if isinstance(decision, Stop):
            break
        after = dynamics.step(scene[None], decision.push[None])[0]
        np.testing.assert_allclose(decision.predicted, after)
        act(agent, executed(decision.push_id, decision.push, scene, after))
        scene = after
    assert (decision.reason, decision.failure) == (StopReason.REACHED, "")
    assert np.linalg.norm(scene[TARGET, POSITION] - PLACE) <= 0.01
    assert 1 <= agent.pushes == number - 1


def test_a_goal_that_was_reached_is_over_whatever_happens_to_the_bodies(agent, scene):
    there = replace(TASK, goal=Goal.place(*scene[TARGET, POSITION]))
    assert stopped(begun(agent, scene, there)).reason is StopReason.REACHED
    moved = scene.copy()
    moved[TARGET, POSITION] = PLACE
    for ids in ((1, 2), (2, 3)):  # by hand, and by a reset
        assert act(agent, SceneObserved(moved, *ids), TimePassed()) is None
    again = replace(TASK, goal_id=2, goal=Goal.place(*scene[TARGET, POSITION]))
    pushed(act(agent, GoalGiven(again)))


def test_goal_and_scene_come_in_any_order_and_an_unsettled_scene_is_not_decided_on(agent, scene):
    assert act(agent, TimePassed(), GoalGiven(TASK), SceneObserved(scene, 1, 1, False)) is None
    assert pushed(act(agent, SceneObserved(scene, 1, 2))).job.observed.key == (1, 2)
    assert act(agent, TimePassed(), SceneObserved(scene, 1, 2)) is None  # each scene once
    assert pushed(act(agent, GoalGiven(replace(TASK, goal_id=2)))).job.task.goal_id == 2


def test_a_push_outside_the_limits_is_never_sent(scene):
    agent = Agent(Fixed([0.0, 0.0, 0.5]), CONFIG)
    stop = stopped(begun(agent, scene))
    assert stop.failure == "OutOfRangeError: push length is 0.5000 m; allowed: [0, 0.15] m"
    assert agent.pushes == 0


def test_refused_pushes_are_replaced_until_the_limit(agent, scene):
    decision, pushes = begun(agent, scene), []
    for _ in range(CONFIG.max_refusals):
        pushes.append(pushed(decision).push)
        decision = act(agent, PushEnded(decision.push_id, ErrorCode.BLOCKED, message="no way"))
    stop, sent = stopped(decision), agent.pushes
    assert sent == 0
    assert (
        stop.failure
        == "NoPushError: 10 pushes in a row were refused from this scene, the last: no way"
    )
    apart = [np.abs(a - b).max() for i, a in enumerate(pushes) for b in pushes[:i]]
    assert min(apart) > 0.02


def first_push(scene, config=CONFIG, task=TASK, ids=(1, 1)):
    agent = planning_agent(Still(), Still(), config)
    return pushed(act(agent, GoalGiven(task), SceneObserved(scene, *ids))).push


def test_random_streams_depend_on_seed_goal_and_scene_and_on_no_id_from_the_wire(scene):
    usual = first_push(scene)
    for same in (
        first_push(scene, task=replace(TASK, goal_id=7, episode_id=9), ids=(9, 314)),
        first_push(scene + 1e-9),
    ):
        np.testing.assert_allclose(same, usual, rtol=0.0, atol=1e-6)
    others = (
        first_push(scene, config=replace(CONFIG, seed=1)),
        first_push(scene, task=replace(TASK, goal=Goal.place(*PLACE + 1e-4, 0.01))),
        first_push(scene + np.array([1e-4, 0, 0, 0, 0, 0, 0, 0])),
    )
    for other in others:
        assert np.abs(other - usual).max() > 1e-3


@pytest.mark.parametrize("history", [True, False])
def test_a_plan_rests_on_its_own_episode_s_pushes_and_on_none_if_so_configured(scene, history):
    model, physics = Still(), Still()
    agent = planning_agent(model, physics, replace(CONFIG, history=history))
    act(agent, GoalGiven(TASK), executed(SOMEBODY, PUSH, scene, scene))
    for episode in (1, 2):
        sent = pushed(act(agent, SceneObserved(scene, episode, 1)))
        act(agent, PushEnded(sent.push_id, ErrorCode.OK))
    assert (model.conditioned, physics.conditioned) == ([int(history), 0], [])


def test_a_long_history_loses_many_pushes_at_once(scene):
    """A model goes on from the history before: one without its oldest push begins anew."""
    for number in range(MOST_PUSHES + 3):
        model = Still()
        agent = planning_agent(model, model, CONFIG)
        act(agent, *[executed(SOMEBODY, PUSH, scene, scene)] * number)
        begun(agent, scene)
        kept = number if number < MOST_PUSHES else number - MOST_PUSHES + KEPT_PUSHES
        assert model.conditioned[0] == kept


def work(agent, *events) -> Computation:
    """Return the only work that events ask for."""
    [found] = [action for event in events for action in agent.update(event)]
    assert isinstance(found, Computation), found
    return found


def test_work_that_raised_is_a_stop_and_what_the_push_need_not_wait_for_is_not(agent, scene):
    bug = ZeroDivisionError("a bug")
    first = work(agent, GoalGiven(TASK), SceneObserved(scene, 1, 1))
    [stop] = agent.update(first.failed(bug))
    assert (stop.reason, stop.error, stop.job.task) == (StopReason.FAILED, bug, TASK)
    decision, complete, prepare = agent.update(
        work(agent, GoalGiven(replace(TASK, goal_id=2))).run()
    )
    assert complete.failed(bug).decision is decision
    assert agent.update(complete.failed(bug)) == agent.update(prepare.failed(bug)) == ()


def test_an_episode_that_begins_again_has_no_result_of_the_push_under_way(agent, scene):
    episode = EpisodeBegun(1, PAPER_DISKS)
    act(agent, episode)
    pushed(begun(agent, scene))
    assert (act(agent, episode), agent.pushes) == (None, 0)
    pushed(act(agent, SceneObserved(scene, 1, 1)))  # the next scene to arrive is decided on


def test_scenes_wait_for_the_bodies_of_their_episode(agent, scene):
    act(agent, GoalGiven(TASK))
    assert act(agent, SceneObserved(scene, 1, 1, bodies_follow=True)) is None
    assert agent.early == 1
    assert pushed(act(agent, EpisodeBegun(1, PAPER_DISKS))).job.observed.key == (1, 1)


def test_a_decision_is_cancelled_while_it_is_made(scene):
    class Slow(Still):
        """Answers each question when the test allows it."""

        def rollout(self, scene, pushes):
            asked.set()
            answer.wait(10.0)
            return super().rollout(scene, pushes)

    asked, answer, decided = Event(), Event(), []
    agent = planning_agent(Slow(), Slow(), CONFIG)
    job = work(agent, GoalGiven(TASK), SceneObserved(scene, 1, 1))
    worker = Thread(target=lambda: decided.append(job.run()))
    worker.start()
    assert asked.wait(10.0)
    stopped(*agent.update(GoalCancelled()))
    answer.set()
    worker.join(10.0)
    assert decided[0].outcome is None and agent.update(decided[0]) == ()


class Adjusting(IdentityPrior):
    """A model that changes the settings while it is asked."""

    decider: PlanningDecider

    def __init__(self, dynamics):
        self.model = dynamics

    def rollout(self, scene, pushes):
        self.decider.adjust(PlannerConfig(samples=12, horizon=1))
        return self.model.rollout(scene, pushes)


def test_a_plan_in_progress_keeps_its_settings(scene, dynamics):
    model = Adjusting(dynamics)
    model.decider = PlanningDecider(model, model, CONFIG.planner)
    agent = Agent(model.decider, CONFIG)
    first = pushed(begun(agent, scene))
    assert (first.settings, len(first.plan.pushes)) == (CONFIG.planner, 2)
    then = pushed(act(agent, GoalGiven(replace(TASK, goal_id=2))))
    assert (then.settings.samples, len(then.plan.pushes)) == (12, 1)
