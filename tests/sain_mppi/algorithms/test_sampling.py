"""Samples lie inside the limits without piling up, and locations live on a circle."""

import numpy as np

from sain_core.goal import Goal
from sain_core.push import LENGTH, PushLimits, make_push
from sain_core.randomness import generator
from sain_mppi.algorithms.sampling import weighted_mean
from sain_mppi.algorithms.search import Search
from sain_mppi.config import CostWeights, PlannerConfig
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.problem import Problem
from sain_mppi.objective.proposals import candidates

LIMITS = PushLimits()


def objective_of(scene, x, y):
    return Objective(Problem.of(scene, Goal.place(x, y)), CostWeights())


def uniform_sequences(limits, random, count, horizon):
    return limits.sample(random, count * horizon).reshape(count, horizon, 5)


def assert_inside(sequences):
    for push in sequences.reshape(-1, 5):
        LIMITS.check(push)


def test_candidates_are_inside_the_limits(scene):
    drawn = candidates(objective_of(scene, 0.3, 0.2), generator(3), 400, 6)
    assert drawn.shape == (400, 6, 5)
    assert_inside(drawn)


def test_pushes_that_end_before_they_touch_are_rests(scene, dynamics):
    drawn = uniform_sequences(LIMITS, generator(8), 200, 3)
    drawn[:, 1, LENGTH] = generator(9).uniform(0.0, 2 * LIMITS.clearance, 200)
    short = drawn[..., LENGTH] <= LIMITS.clearance
    assert short.any() and not short.all()
    search = Search(dynamics, PlannerConfig(), objective_of(scene, 0.7, 0.0))
    kept = search.without_idle(drawn.copy())
    assert (kept[short][:, LENGTH] == 0.0).all()
    np.testing.assert_array_equal(kept[~short], drawn[~short])


def test_the_mean_of_locations_is_taken_on_the_circle():
    sequences = make_push([[3.0], [-3.0]], [[0.1], [0.3]], [[0.05], [0.15]])
    mean = weighted_mean(sequences, np.array([0.5, 0.5]))
    np.testing.assert_allclose(mean, make_push(np.pi, 0.2, 0.1)[None])
