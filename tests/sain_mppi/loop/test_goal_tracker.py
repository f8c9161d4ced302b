from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ErrorCode, OffTableError
from sain_core.scene import Table, make_scene
from sain_mppi.loop.goal_tracker import Job, Pursuit, PursuitConfig, Task, Verdict, View

SCENE = make_scene(np.array([(0.4, 0.0), (0.55, 0.0)]), np.full(2, 8.0), np.array([0.08, 0.06]))
TASK = Task(1, 0, np.array([0.7, 0.0]), 0.01, 0)


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def view(scene_id: int = 1, episode_id: int = 1, settled: bool = True) -> View:
    return View(SCENE, episode_id, scene_id, settled, 0.0)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def pursuit(clock: Clock) -> Pursuit:
    return Pursuit(PursuitConfig(max_refusals=2, answer_timeout=5.0), Table(), clock)


def job_of(pursuit: Pursuit) -> Job:
    job = pursuit.next_job()
    assert job is not None
    return job


def test_it_takes_a_goal_and_a_settled_scene_in_any_order(pursuit: Pursuit) -> None:
    pursuit.see(view())
    assert pursuit.next_job() is None
    pursuit.aim(TASK)
    assert job_of(pursuit).view.key == (1, 1)
    pursuit.see(view(2, settled=False))
    assert pursuit.next_job() is None
    pursuit.see(view(2))
    assert job_of(pursuit).view.key == (1, 2)


def test_each_scene_is_decided_on_once_a_goal(pursuit: Pursuit) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.see(view())
    assert pursuit.next_job() is None
    pursuit.aim(replace(TASK, goal_id=2))
    assert job_of(pursuit).task.goal_id == 2


def test_a_goal_of_one_episode_waits_for_it(pursuit: Pursuit) -> None:
    pursuit.aim(replace(TASK, episode_id=2))
    pursuit.see(view(episode_id=1))
    assert pursuit.next_job() is None
    pursuit.see(view(5, episode_id=2))
    assert job_of(pursuit).view.episode_id == 2


def test_a_goal_that_cannot_be_served_leaves_none(pursuit: Pursuit) -> None:
    pursuit.aim(TASK)
    with pytest.raises(OffTableError):
        pursuit.aim(replace(TASK, goal=np.array([9.0, 0.0])))
    pursuit.see(view())
    assert pursuit.next_job() is None


def test_a_job_is_unwanted_once_its_goal_or_scene_is_past(pursuit: Pursuit) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job = job_of(pursuit)
    assert pursuit.wants(job)
    pursuit.see(view(2))
    assert not pursuit.wants(job)
    pursuit.see(view(1))
    pursuit.aim(replace(TASK))
    assert not pursuit.wants(job)


def test_verdicts(pursuit: Pursuit) -> None:
    pursuit.aim(replace(TASK, max_pushes=1))
    pursuit.see(view())
    job = job_of(pursuit)
    assert pursuit.verdict(job) is Verdict.PLAN
    assert pursuit.verdict(replace(job, attempt=2)) is Verdict.GIVE_UP
    pursuit.sent(7)
    assert pursuit.verdict(job) is Verdict.EXHAUSTED
    there = replace(job.task, goal=SCENE[1, :2])
    assert pursuit.verdict(replace(job, task=there)) is Verdict.REACHED


def test_a_push_refused_for_itself_is_to_be_replaced(pursuit: Pursuit) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    for attempt in range(3):
        assert job_of(pursuit).attempt == attempt
        pursuit.sent(10 + attempt)
        assert pursuit.answered(10 + attempt, ErrorCode.BLOCKED)
    assert pursuit.pushes == 0


@pytest.mark.parametrize("code", [ErrorCode.STALE_SCENE, ErrorCode.BUSY, ErrorCode.UNKNOWN_EPISODE])
def test_a_push_refused_for_its_scene_waits_for_the_next_look(pursuit, code) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(10)
    assert not pursuit.answered(10, code)
    assert pursuit.next_job() is None
    pursuit.see(view())  # it was the current one after all
    assert job_of(pursuit).attempt == 0


def test_what_becomes_of_others_pushes_does_not_matter(pursuit: Pursuit) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(10)
    assert not pursuit.answered(99, ErrorCode.BLOCKED)
    assert (pursuit.pushes, pursuit.next_job()) == (1, None)


def test_a_late_refusal_of_a_past_scene_only_counts(pursuit: Pursuit, clock: Clock) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(10)
    pursuit.see(view(2))
    clock.now = 1.0
    job = job_of(pursuit)
    assert not pursuit.answered(10, ErrorCode.STALE_SCENE)
    assert pursuit.wants(job)
    assert pursuit.pushes == 0


def test_a_push_that_is_never_answered_is_planned_again(pursuit: Pursuit, clock: Clock) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(10)
    clock.now = 4.0
    pursuit.see(view())
    assert pursuit.next_job() is None
    clock.now = 6.0
    pursuit.see(view())
    assert job_of(pursuit).view.key == (1, 1)


def test_a_scene_waits_for_the_result_of_the_push_before(pursuit: Pursuit, clock: Clock) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(7)
    pursuit.see(view(2, settled=False))
    clock.now = 100.0  # however long it moves
    pursuit.see(view(2))
    assert pursuit.next_job() is None
    assert not pursuit.answered(7, ErrorCode.OK)
    assert job_of(pursuit).view.key == (1, 2)


def test_a_result_that_does_not_come_is_not_waited_for_any_longer(
    pursuit: Pursuit, clock: Clock
) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(7)
    pursuit.see(view(2))
    clock.now = 0.49
    pursuit.see(view(2))
    assert pursuit.next_job() is None
    clock.now = 0.51
    assert job_of(pursuit).view.key == (1, 2)


def test_a_result_that_was_lost_delays_one_plan_alone(pursuit: Pursuit, clock: Clock) -> None:
    pursuit.aim(TASK)
    pursuit.see(view())
    job_of(pursuit)
    pursuit.sent(7)
    pursuit.see(view(2))
    clock.now = 1.0
    job_of(pursuit)  # without the result of push 7, which never comes
    pursuit.sent(8)
    pursuit.see(view(3))
    assert not pursuit.answered(8, ErrorCode.OK)
    assert job_of(pursuit).view.key == (1, 3)
