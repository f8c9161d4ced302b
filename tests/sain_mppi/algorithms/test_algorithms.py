"""What every algorithm promises, over a toy model that only knows how to push disks apart."""

from dataclasses import replace
from time import monotonic, sleep

import numpy as np
import pytest

from sain_core.errors import ModelUnavailableError, NoPushError
from sain_core.feasibility import Feasibility, Reach
from sain_core.goal import Goal
from sain_core.model import IdentityPrior
from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.randomness import generator
from sain_core.scene import MASS, make_scene, unit
from sain_mppi.algorithms import ALGORITHMS
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

GOAL = Goal.place(0.68, 0.05)
CONFIG = PlannerConfig(samples=192)


pytestmark = pytest.mark.parametrize("algorithm", ALGORITHMS)


def problem(scene, goal=GOAL, feasibility=Feasibility()):
    return Problem.of(scene, goal, feasibility=feasibility)


def planner(model, algorithm, **changes):
    return Planner(model, replace(CONFIG, algorithm=algorithm, **changes))


class Changed(IdentityPrior):
    """A model whose answers are spoiled."""

    def __init__(self, dynamics, spoil):
        self.inner, self.spoil = dynamics, spoil

    def rollout(self, scene, pushes):
        return self.spoil(self.inner.rollout(scene, pushes))


class Slow(IdentityPrior):
    """A model that takes its time for each sequence."""

    def __init__(self, dynamics, seconds):
        self.inner, self.seconds = dynamics, seconds

    def rollout(self, scene, pushes):
        sleep(self.seconds * len(pushes))
        return self.inner.rollout(scene, pushes)


def assert_permitted(push, scene):
    Feasibility().limits.check(push)
    assert Feasibility().mask(scene, push)
    assert push[LENGTH] > Feasibility().limits.clearance


@pytest.mark.parametrize(("disks", "seed"), [(2, 0), (4, 1)])
def test_every_push_is_one_that_the_arm_can_do(algorithm, dynamics, seed, disks):
    random = generator(seed, "scenes")
    mid = np.array([0.45, 0.0]) + random.uniform(-0.08, 0.08, 2)
    ring = random.uniform(-0.5, 0.5) + 2.2 * np.arange(disks - 1)
    places = np.stack([mid, *(mid + 0.15 * unit(ring))])
    radii = np.array([0.08] + [0.06] * (disks - 1))
    scene = make_scene(places, np.full(disks, 8.0), radii)
    plan = planner(dynamics, algorithm).plan(problem(scene), random)
    assert_permitted(plan.push, scene)
    assert plan.predicted.shape == (CONFIG.horizon, disks, 8)


def test_the_result_is_what_the_model_says_of_the_plan(algorithm, scene, dynamics):
    plan = planner(dynamics, algorithm).plan(problem(scene), generator(0))
    predicted = dynamics.rollout(scene, plan.pushes[None])[0]
    np.testing.assert_allclose(plan.predicted, predicted)
    assert plan.cost == pytest.approx(sum(plan.terms.values()))
    assert plan.improves and 1.0 <= plan.effective_samples <= plan.samples
    assert 0.0 < plan.times.rollout + plan.times.cost < plan.times.total


def test_refused_pushes_are_not_tried_again_from_the_same_scene(algorithm, scene, dynamics):
    plans, refused = planner(dynamics, algorithm), []
    for number in range(3):
        asked = replace(problem(scene), refused=tuple(refused))
        push = plans.plan(asked, generator(number)).push
        for before in refused:
            apart = np.abs(push - before)
            apart[LOCATION] = min(apart[LOCATION], 2 * np.pi - apart[LOCATION])
            assert apart[LOCATION] > 0.15 or apart[ANGLE] > 0.15 or apart[LENGTH] > 0.02
        refused.append(push)


def test_a_deadline_leaves_the_best_until_then(algorithm, scene, dynamics):
    """The model takes 1 ms for each sequence: all of a plan's would take 105 ms and more."""
    plans = planner(Slow(dynamics, 0.001), algorithm)
    plan = plans.plan(problem(scene), generator(0), deadline=monotonic() + 0.07)
    assert_permitted(plan.push, scene)
    assert 64 <= plan.samples < 105


def test_sequences_that_the_model_cannot_predict_are_not_chosen(algorithm, scene, dynamics):
    def half_nan(predicted):
        predicted[::2] = np.nan
        return predicted

    plan = planner(Changed(dynamics, half_nan), algorithm).plan(problem(scene), generator(0))
    assert np.isfinite(plan.predicted).all() and np.isfinite(plan.cost)
    assert np.isfinite(plan.others.predicted).all()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda predicted: np.full_like(predicted, np.nan), "predictions is finite"),
        (lambda predicted: predicted + np.eye(8)[MASS], "masses or radii"),
    ],
)
def test_an_answer_that_is_none_is_told(algorithm, scene, dynamics, spoil, message):
    with pytest.raises(ModelUnavailableError, match=message):
        planner(Changed(dynamics, spoil), algorithm).plan(problem(scene), generator(0))


def test_no_push_left_is_an_error_that_says_where(algorithm, scene, dynamics):
    nowhere = Feasibility(reach=Reach(inner=0.50, outer=0.74, max_bearing=1.0))
    with pytest.raises(NoPushError, match=r"body 0 at \(0\.400, 0\.000\)"):
        planner(dynamics, algorithm).plan(problem(scene, feasibility=nowhere), generator(0))
