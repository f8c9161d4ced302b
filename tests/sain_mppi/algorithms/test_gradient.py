"""Gradient descent on models and costs of which it is known where downhill is."""

from dataclasses import replace

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.model import Model
from sain_core.push import LENGTH, idle_pushes, make_push, push_direction
from sain_core.randomness import generator
from sain_core.scene import POSITION, unit
from sain_core.types import Pushes, PushSequences, Scalars, Scenes
from sain_mppi.algorithms.gradient import gradient
from sain_mppi.algorithms.search import Search
from sain_mppi.config import GRADIENT, PlannerConfig
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.problem import Problem

PLACE = np.array([0.62, 0.07])
GOAL = Goal.place(*PLACE)
CONFIG = PlannerConfig(algorithm=GRADIENT, samples=64, horizon=3)
NOTHING = idle_pushes(0, CONFIG.horizon)


class Gliding(Model):
    """Smooth: all disks go where the tool goes, as far as it goes."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        after = scenes.copy()
        way = unit(push_direction(pushes)) * pushes[:, LENGTH, None]
        after[..., POSITION] += way[:, None]
        return after


class Recorded(Search):
    """A search that remembers what it was asked."""

    def __init__(self, dynamics, config, scene):
        super().__init__(dynamics, config, Objective(Problem.of(scene, GOAL), config.weights))
        self.drawn: list[Scalars] = []
        self.probed: list[PushSequences] = []

    def evaluate(self, sequences):
        self.drawn.append(super().evaluate(sequences))
        return self.drawn[-1]

    def probe(self, sequences):
        self.probed.append(sequences)
        return super().probe(sequences)


def test_it_gets_far_below_its_starts_on_a_smooth_model(scene):
    search = Recorded(Gliding(), CONFIG, scene)
    gradient(search, NOTHING, generator(0))
    predicted = search.result().predicted[-1, 1, POSITION]
    drawn = min(costs.min() for costs in search.drawn)
    assert search.elites.cost < 0.8 * drawn
    assert np.linalg.norm(predicted - PLACE) < 0.002


def test_rests_stay_rests_and_steps_stay_inside_the_limits(scene):
    search = Recorded(Gliding(), replace(CONFIG, samples=2, stop_share=1.0), scene)
    start = make_push([[0.1, 0.0, 0.2]], [[0.7, 0.0, -0.78]], [[0.145, 0.0, 0.01]])
    gradient(search, start, generator(0))
    probed = np.concatenate(search.probed)
    assert (probed[:, 1, LENGTH] == 0.0).all() and (probed[:, 2, LENGTH] != 0.01).any()
    limits = Feasibility().limits
    for push in probed.reshape(-1, 5):
        limits.check(push)
