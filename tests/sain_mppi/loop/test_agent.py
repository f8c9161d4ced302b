"""The agent, without ROS: what goes in and what comes out."""

from dataclasses import replace
from threading import Event, Thread

import numpy as np
import pytest

from sain_core.dynamics import StepwiseRollout
from sain_core.errors import ErrorCode, InvalidInputError, ModelUnavailableError
from sain_core.history import PushHistory
from sain_core.scene import POSITION, TARGET
from sain_mppi.loop.agent import Agent, AgentConfig, planning_agent
from sain_mppi.loop.decision import Decider, PlanJob, PushDecision, Stop, StopReason, Task
from sain_mppi.search.config import PlannerConfig

CONFIG = AgentConfig(planner=PlannerConfig(samples=32, rounds=2, horizon=2))
TASK = Task(1, 0, np.array([0.70, 0.05]), 0.01, 0)
PUSH = np.array([0.0, 0.1, 0.05])


class Still:
    """Predicts that nothing moves, and keeps how many earlier pushes it was conditioned on."""

    def __init__(self):
        self.conditioned = []

    def with_history(self, history: PushHistory) -> "Still":
        self.conditioned.append(len(history))
        return self

    def rollout(self, scene, pushes):
        return np.broadcast_to(scene, (*pushes.shape[:2], *scene.shape)).copy()


class Silent(Still):
    """Never answers."""

    def rollout(self, scene, pushes):
        raise ModelUnavailableError("silent")


class Fixed(Decider):
    """Wants the same push whatever happens."""

    def __init__(self, push):
        self.push = np.array(push)

    def decide(self, job, generator):
        return PushDecision(job, self.push)


@pytest.fixture
def agent(dynamics):
    model = StepwiseRollout(dynamics)
    return planning_agent(model, model, CONFIG)


def pushed(decision) -> PushDecision:
    assert isinstance(decision, PushDecision), decision
    return decision


def stopped(decision) -> Stop:
    assert isinstance(decision, Stop), decision
    return decision


def test_it_brings_the_target_to_the_goal_and_stops(agent, scene, dynamics):
    agent.aim(TASK)
    for number in range(1, 10):
        agent.see(scene, 1, number, True)
        decision = agent.act()
        if isinstance(decision, Stop):
            break
        after = dynamics.step(scene[None], decision.push[None])[0]
        np.testing.assert_allclose(decision.predicted, after)
        agent.learn(1, scene, decision.push, after)
        assert not agent.answered(decision.push_id, ErrorCode.OK)
        scene = after
    assert (decision.reason, decision.failure) == (StopReason.REACHED, "")
    assert np.linalg.norm(scene[TARGET, POSITION] - TASK.goal) <= 0.01
    assert 1 <= agent.pushes == number - 1


def test_goal_and_scene_come_in_any_order_and_an_unsettled_scene_is_not_decided_on(agent, scene):
    assert agent.act() is None
    agent.aim(TASK)
    assert agent.act() is None
    agent.see(scene, 1, 1, False)
    assert agent.act() is None
    agent.see(scene, 1, 2, True)
    assert pushed(agent.act()).job.view.key == (1, 2)
    assert agent.act() is None  # each scene once
    agent.aim(replace(TASK, goal_id=2))
    assert pushed(agent.act()).job.task.goal_id == 2


def test_a_goal_that_cannot_be_served_is_a_stop(agent, scene):
    agent.see(scene, 1, 1, True)
    stop = stopped(agent.aim(replace(TASK, goal=np.array([3.0, 0.0]))))
    assert (stop.reason, stop.error.code) == (StopReason.FAILED, ErrorCode.OFF_TABLE)
    assert stop.failure.startswith("OffTableError: the goal (3.000, 0.000) m is off the table")
    assert agent.act() is None


def test_a_disk_off_the_table_is_a_stop(scene):
    agent = Agent(Fixed(PUSH), CONFIG)
    agent.aim(TASK)
    scene[TARGET, 0] = 1.5
    agent.see(scene, 1, 1, True)
    assert stopped(agent.act()).error.code is ErrorCode.OFF_TABLE


def test_a_push_outside_the_limits_is_never_sent(scene):
    agent = Agent(Fixed([0.0, 0.0, 0.5]), CONFIG)
    agent.aim(TASK)
    agent.see(scene, 1, 1, True)
    stop = stopped(agent.act())
    assert stop.failure == "OutOfRangeError: push length is 0.5000 m; allowed: [0, 0.15] m"
    assert agent.pushes == 0


def test_refused_pushes_are_replaced_until_the_limit(agent, scene):
    agent.aim(TASK)
    agent.see(scene, 1, 1, True)
    pushes = []
    for _ in range(CONFIG.goal_tracker.max_refusals):
        decision = pushed(agent.act())
        pushes.append(decision.push)
        assert agent.answered(decision.push_id, ErrorCode.BLOCKED)
    stop = stopped(agent.act())
    assert stop.failure == "NoPushError: 10 pushes in a row were refused from this scene"
    apart = [np.abs(a - b).max() for i, a in enumerate(pushes) for b in pushes[:i]]
    assert min(apart) > 0.02


def test_what_happens_to_the_pushes_of_others_does_not_matter(agent, scene):
    agent.aim(TASK)
    agent.see(scene, 1, 1, True)
    own = pushed(agent.act()).push_id
    assert not agent.answered(own + 1, ErrorCode.BLOCKED)
    assert (agent.act(), agent.pushes) == (None, 1)


def first_push(scene, config=CONFIG, task=TASK, ids=(1, 1)):
    agent = planning_agent(Still(), Still(), config)
    agent.aim(task)
    agent.see(scene, *ids, True)
    return pushed(agent.act()).push


def test_random_streams_depend_on_seed_goal_and_scene_and_on_no_id_from_the_wire(scene):
    usual = first_push(scene)
    for same in (
        first_push(scene, task=replace(TASK, goal_id=7, episode_id=9), ids=(9, 314)),
        first_push(scene + 1e-9),
    ):
        np.testing.assert_allclose(same, usual, rtol=0.0, atol=1e-6)
    others = (
        first_push(scene, config=replace(CONFIG, seed=1)),
        first_push(scene, task=replace(TASK, goal=TASK.goal + 1e-4)),
        first_push(scene + np.array([1e-4, 0, 0, 0, 0, 0, 0, 0])),
    )
    for other in others:
        assert np.abs(other - usual).max() > 1e-3


def test_each_push_and_each_refusal_has_a_stream_of_its_own(scene):
    agent = planning_agent(Still(), Still(), CONFIG)
    agent.aim(TASK)
    streams = []
    scene_id = 1
    for code in (ErrorCode.OK, ErrorCode.BLOCKED, ErrorCode.OK):
        agent.see(scene, 1, scene_id, True)
        decision = pushed(agent.act())
        streams.append(decision.job.stream)
        agent.answered(decision.push_id, code)
        scene_id += code is ErrorCode.OK
    assert [stream[1:] for stream in streams] == [(0, 0), (1, 0), (1, 1)]
    assert len({stream[0] for stream in streams}) == 1


def test_the_same_goal_sent_again_begins_anew(agent, scene):
    for _ in range(2):  # same numbers, but another task
        agent.aim(replace(TASK, goal=TASK.goal.copy()))
        agent.see(scene, 1, 1, True)
        assert pushed(agent.act()).last is None


@pytest.mark.parametrize("history", [True, False])
def test_a_plan_rests_on_its_own_episode_s_pushes_and_on_none_if_so_configured(scene, history):
    model, physics = Still(), Still()
    agent = planning_agent(model, physics, replace(CONFIG, history=history))
    agent.aim(TASK)
    agent.learn(1, scene, PUSH, scene)
    for episode in (1, 2):
        agent.see(scene, episode, 1, True)
        agent.answered(pushed(agent.act()).push_id, ErrorCode.OK)
    assert (model.conditioned, physics.conditioned) == ([int(history), 0], [])


def test_what_cannot_have_happened_is_not_learned(agent, scene):
    with pytest.raises(InvalidInputError, match="changed a mass or radius"):
        agent.learn(1, scene, PUSH, scene + 0.1)


def test_physics_takes_over_with_the_same_history_and_the_decision_says_so(scene):
    physics = Still()
    agent = planning_agent(Silent(), physics, CONFIG)
    agent.aim(TASK)
    agent.learn(1, scene, PUSH, scene)
    agent.see(scene, 1, 1, True)
    decision = pushed(agent.act())
    assert (physics.conditioned, str(decision.failure)) == ([1], "silent")
    assert decision.plan.regions is None  # a model that failed is not asked for them


def test_a_decision_that_is_no_longer_wanted_is_not_sent(agent, scene):
    agent.aim(TASK)
    agent.see(scene, 1, 1, True)
    job = agent.next()
    assert isinstance(job, PlanJob) and agent.next() is None
    decision = agent.decide(job)
    agent.aim(replace(TASK, goal_id=2))
    assert agent.next() is None and job.cancelled.is_set()  # one job at a time
    assert agent.conclude(decision) is None
    assert agent.pushes == 0
    assert agent.next().task.goal_id == 2


def test_any_thread_may_cancel_a_decision(scene):
    class Slow(Still):
        """Answers each question when the test allows it."""

        def rollout(self, scene, pushes):
            asked.set()
            answer.wait(10.0)
            return super().rollout(scene, pushes)

    asked, answer, decided = Event(), Event(), []
    agent = planning_agent(Slow(), Slow(), CONFIG)
    agent.aim(TASK)
    agent.see(scene, 1, 1, True)
    job = agent.next()
    worker = Thread(target=lambda: decided.append(agent.decide(job)))
    worker.start()
    assert asked.wait(10.0)
    agent.cancel()
    answer.set()
    worker.join(10.0)
    assert decided == [None] and agent.conclude(None) is None
