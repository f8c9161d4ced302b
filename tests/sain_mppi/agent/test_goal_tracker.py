from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ErrorCode
from sain_core.goal import Goal
from sain_core.push import make_push
from sain_core.scene import make_scene
from sain_mppi.agent.events import PlanJob, SceneObserved, StopReason, Task
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


def test_a_job_at_the_goal_without_pushes_left_or_refused_too_often_is_a_stop(tracker):
    tracker.set_goal(replace(TASK, max_pushes=1))
    tracker.observe(view())
    job = job_of(tracker)
    assert tracker.stop(job) is None
    refused = tracker.stop(replace(job, problem=replace(job.problem, refused=(PUSH, PUSH))))
    assert refused is not None and refused.reason is StopReason.FAILED
    assert refused.failure == "NoPushError: 2 pushes in a row were refused from this scene"
    tracker.sent(7, PUSH)
    exhausted = tracker.stop(job)
    assert exhausted is not None and exhausted.reason is StopReason.EXHAUSTED
    assert exhausted.failure == "1 pushes left body 1 150.0 mm and 0.000 rad from its pose"
    reached = replace(job.problem, goal=Goal.place(*SCENE[1, :2]))
    there = tracker.stop(replace(job, problem=reached))
    assert there is not None and (there.reason, there.failure) == (StopReason.REACHED, "")


def test_sessions_end_with_goal_and_episode_and_when_a_scene_was_not_the_current_one(tracker):
    tracker.set_goal(TASK)
    tracker.observe(view(1))
    first = job_of(tracker)
    tracker.observe(view(2))
    second = job_of(tracker)
    assert (second.session, second.problem.start is first.problem.start) == (first.session, True)
    tracker.sent(10, PUSH)
    tracker.ended(10, ErrorCode.STALE_SCENE)
    tracker.observe(view(3))
    third = job_of(tracker)
    tracker.observe(view(4, episode_id=2))
    fourth = job_of(tracker)
    tracker.set_goal(replace(TASK, goal_id=2))
    sessions = [second.session, third.session, fourth.session, job_of(tracker).session]
    assert len(set(sessions)) == 4


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
