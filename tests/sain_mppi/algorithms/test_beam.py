"""The beam search before the rounds: for bodies with corners, within a deadline, and of use."""

from dataclasses import replace

import numpy as np

from sain_core.goal import BodyPose, Goal
from sain_core.randomness import generator
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_model.physics.planar import PlanarPrior
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

BODIES = Bodies.named(["t"])
SCENE = make_scene(np.array([[0.45, -0.05]]), np.array([8.0]), np.array([0.10]))
GOAL = Goal((BodyPose(0, 0.55, 0.12, 1.5, 0.005, 0.03),))
CONFIG = PlannerConfig(samples=64)


def plan(config, seed=0, deadline=None):
    model = PlanarPrior().with_bodies(BODIES)
    planner = Planner(model, config)
    return planner.plan(Problem.of(SCENE, GOAL, BODIES), generator(seed), deadline=deadline)


def test_it_tries_pushes_after_the_best_pushes_and_halves_the_rounds():
    found = plan(CONFIG)
    assert found.samples == 256 + 3 * 16 * 12 + 32 + 16 + 8
    assert found.rounds == CONFIG.rounds
    np.testing.assert_array_equal(found.pushes, plan(CONFIG).pushes)


def test_a_plan_is_better_than_one_of_as_many_pushes_without_it():
    """832 sequences of the beam, of 1 to 4 pushes, are 496 of 4 pushes."""
    alone = replace(CONFIG, samples=312, beam=0)  # 312 + 156 + 78
    costs = [[plan(config, seed).cost for config in (CONFIG, alone)] for seed in range(4)]
    with_beam, without = np.mean(costs, axis=0)
    assert with_beam < 0.9 * without
