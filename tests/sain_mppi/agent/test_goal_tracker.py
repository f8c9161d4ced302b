from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ErrorCode
from sain_core.goal import Goal
from sain_core.push import make_push
from sain_core.scene import make_scene
from sain_mppi.agent.events import PlanJob, SceneObserved, Task
from sain_mppi.agent.goal_tracker import GoalTracker
from sain_mppi.objective.problem import Problem

SCENE = make_scene(np.array([(0.4, 0.0), (0.55, 0.0)]), np.full(2, 8.0), np.array([0.08, 0.06]))
PUSH = make_push(0.0, 0.1, 0.05)
TASK = Task(1, 0, Goal.place(0.7, 0.0, 0.01), 0)


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def view(scene_id: int = 1, episode_id: int = 1, settled: bool = True) -> SceneObserved:
    return SceneObserved(SCENE, episode_id, scene_id, settled)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def tracker(clock):
    return GoalTracker(2, 5.0, 0.5, clock)


def job_of(tracker: GoalTracker) -> PlanJob:
    scene = tracker.next_scene()
    assert scene is not None and tracker.task is not None and tracker.start is not None
    problem = Problem.of(scene.scene, tracker.task.goal, start=tracker.start.scene)
    problem = replace(problem, refused=tracker.refused)
    return PlanJob(tracker.task, scene, problem, tracker.session, tracker.pushes)


@pytest.mark.parametrize("code", [ErrorCode.STALE_SCENE, ErrorCode.BUSY, ErrorCode.UNKNOWN_EPISODE])
def test_a_push_refused_for_its_scene_waits_for_the_next_look(tracker, code):
    tracker.set_goal(TASK)
    tracker.observe(view())
    job_of(tracker)
    tracker.sent(10, PUSH)
    tracker.ended(10, code)
    assert tracker.next_scene() is None
    tracker.observe(view())  # it was the current one after all
    assert job_of(tracker).problem.refused == ()


def test_a_push_that_is_never_answered_is_planned_again(tracker, clock):
    tracker.set_goal(TASK)
    tracker.observe(view())
    job_of(tracker)
    tracker.sent(10, PUSH)
    clock.now = 4.0
    tracker.observe(view())
    assert tracker.next_scene() is None
    clock.now = 6.0
    tracker.observe(view())
    assert job_of(tracker).observed.key == (1, 1)


def test_a_scene_waits_for_the_result_of_the_push_before(tracker, clock):
    tracker.set_goal(TASK)
    tracker.observe(view())
    job_of(tracker)
    tracker.sent(7, PUSH)
    tracker.observe(view(2, settled=False))
    clock.now = 100.0  # however long it moves
    tracker.observe(view(2))
    assert tracker.next_scene() is None
    tracker.ended(7, ErrorCode.OK)
    assert job_of(tracker).observed.key == (1, 2)


def test_a_scene_that_a_stray_message_interrupts_is_decided_on_again(tracker):
    tracker.set_goal(TASK)
    tracker.observe(view())
    job = job_of(tracker)
    tracker.observe(view(0, settled=False))
    assert not tracker.is_current(job)  # its decision is not sent
    tracker.observe(view())
    job_of(tracker)
    tracker.sent(10, PUSH)
    tracker.observe(view(0, settled=False))
    tracker.ended(10, ErrorCode.STALE_SCENE)
    tracker.observe(view())
    assert job_of(tracker).observed.key == (1, 1)
