"""From noisy and late frames to one view of a scene."""

import numpy as np
import pytest

from sain_core.errors import ErrorCode, OutOfRangeError
from sain_core.goal import Goal
from sain_core.scene import POSE, POSITION, TARGET, VELOCITY, VX, is_settled
from sain_mppi.agent.estimator import Estimator
from sain_mppi.agent.events import PlanJob, SceneObserved, Task
from sain_mppi.agent.uncertainty import EstimatorConfig, Uncertainty, fuse, in_motion
from sain_mppi.objective.problem import Problem

NOISE = (0.005, 0.035)
CONFIG = EstimatorConfig(noise="0.005,0.035")
PERIOD = 1 / 30


def noisy(scene, count, seed=0):
    random = np.random.default_rng(seed)
    scenes = np.repeat(scene[None], count, axis=0)
    scenes[..., POSE] += random.normal(size=(count, len(scene), 3)) * [0.005, 0.005, 0.035]
    scenes[..., VX] = 0.2  # as differences of noisy frames are
    return scenes


def feed(estimator, scenes, scene_id=1, start=0.0):
    for index, scene in enumerate(scenes):
        time = start + index * PERIOD
        estimator.observe(SceneObserved(scene, 1, scene_id, time=time))


@pytest.fixture
def estimator():
    return Estimator(CONFIG, 0.5, lambda: 0.0)


def test_as_many_frames_are_averaged_as_the_precision_needs(estimator, scene):
    assert CONFIG.frames == 25
    assert EstimatorConfig(noise="0.001,0").frames == 2 and EstimatorConfig(delay=0.1).frames == 1
    assert EstimatorConfig(noise="0.02,0.35").frames == 90  # no more, however noisy
    feed(estimator, noisy(scene, 24))
    assert estimator.estimate() is None
    feed(estimator, noisy(scene, 1, 1), start=24 * PERIOD)
    view = estimator.estimate()
    np.testing.assert_allclose(view.scene[:, POSITION], scene[:, POSITION], atol=0.003)
    np.testing.assert_allclose(view.uncertainty.places, 0.001)
    assert is_settled(view.scene) and not view.scene[:, VELOCITY].any()
    feed(estimator, noisy(scene, 5), start=1.0)
    assert estimator.estimate() is None and estimator.estimated is view  # once a scene


def test_frames_from_before_the_end_of_a_push_do_not_count(estimator, scene):
    feed(estimator, noisy(scene, 25))
    estimator.estimate()
    moved = scene.copy()
    moved[:, 0] += 0.1
    feed(estimator, noisy(scene, 30), scene_id=2, start=1.0)  # late: still of the scene before
    assert estimator.estimate() is None  # the result of the push is not there
    estimator.ended(7, ErrorCode.OK, 2.0)
    assert estimator.estimate() is None
    feed(estimator, noisy(moved, 25, 1), scene_id=2, start=2.01)
    np.testing.assert_allclose(estimator.estimate().scene[:, 0], moved[:, 0], atol=0.003)


def test_bodies_that_still_slide_are_not_at_rest(estimator, scene):
    sliding = noisy(scene, 25)
    assert not in_motion(sliding, np.arange(25) * PERIOD, NOISE)
    sliding[:, TARGET, 0] += 0.03 * np.arange(25) * PERIOD  # 30 mm/s
    assert in_motion(sliding, np.arange(25) * PERIOD, NOISE)
    feed(estimator, sliding)
    assert estimator.estimate() is None
    feed(estimator, noisy(sliding[-1], 25, 2), start=25 * PERIOD)
    assert estimator.estimate() is not None


def test_what_a_push_should_lead_to_counts_by_its_precision(scene):
    frames = list(noisy(scene, 25))
    seen = fuse(frames, NOISE)
    certain = scene, Uncertainty(np.full(2, 1e-6), np.full(2, 1e-6))
    np.testing.assert_allclose(fuse(frames, NOISE, certain)[0][:, POSE], scene[:, POSE], atol=1e-5)
    vague = scene, Uncertainty(np.full(2, 1.0), np.full(2, 9.0))
    uncertain = fuse(frames, NOISE, vague)
    np.testing.assert_allclose(uncertain[0], seen[0], atol=1e-6)
    both = fuse(frames, NOISE, (scene, Uncertainty(np.full(2, 0.001), np.full(2, 1e-6))))
    np.testing.assert_allclose(both[1].places, 0.001 / 2**0.5)


def job(scene, std, tolerance):
    uncertainty = Uncertainty(np.full(2, std), np.full(2, 0.01), 0.95)
    observed = SceneObserved(scene, 1, 1, uncertainty=uncertainty)
    goal = Goal.place(*scene[TARGET, POSITION] + [0.008, 0.0], tolerance)
    return PlanJob(Task(1, 0, goal, 0), observed, Problem.of(scene, goal), 1, 0)


def test_a_goal_is_reached_with_the_wanted_probability(scene):
    assert job(scene, 0.001, 0.010).reached
    assert not job(scene, 0.001, 0.009).reached  # 84 %
    assert not job(scene, 0.004, 0.011).reached


def check_tolerance(job):
    job.observed.uncertainty.check_tolerance(job.problem.goal)


def test_a_tolerance_that_noise_hides_is_refused(scene):
    with pytest.raises(OutOfRangeError, match=r"4\.0 mm .* less than 95 %; choose wider"):
        check_tolerance(job(scene, 0.004, 0.005))
    check_tolerance(job(scene, 0.001, 0.005))
