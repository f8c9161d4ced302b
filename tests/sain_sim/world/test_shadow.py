import dataclasses

import numpy as np
import pytest

from sain_core.model import Model
from sain_core.push import idle_pushes
from sain_core.scene import MASS, MID, RADIUS, TARGET
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.shadow import KINDS, MEASURED, NOMINAL, TRUE, BulletPrior
from sain_sim.world.world import World


def test_the_true_shadow_of_a_fresh_world_is_the_world(bench):
    parameters, start = bench.drawn(3)
    with World(parameters) as world, BulletPrior(TRUE, parameters=parameters) as shadow:
        start = world.reset(start)
        push = bench.towards(np.arctan2(*(start[TARGET, :2] - start[MID, :2])[::-1]))
        assert np.allclose(shadow.predict(start, push), world.push(push).after, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_predictions_are_pure_and_keep_mass_and_radius(kind, bench):
    parameters, start = bench.drawn(5)
    heading = np.arctan2(*(start[TARGET, :2] - start[MID, :2])[::-1])
    pushes = np.array([bench.towards(heading), bench.towards(heading, 0.05), idle_pushes()])
    scenes = np.repeat(start[None], 3, axis=0)
    with BulletPrior(kind, parameters=parameters) as shadow:
        assert isinstance(shadow, Model)
        predicted = shadow.step(scenes, pushes)
        assert np.array_equal(shadow.step(scenes[::-1], pushes[::-1])[::-1], predicted)
    assert np.array_equal(predicted[..., (MASS, RADIUS)], scenes[..., (MASS, RADIUS)])
    assert np.array_equal(predicted[2], start)
    assert predicted[0, TARGET, 0] != start[TARGET, 0]


def test_kinds_differ_in_what_they_know(bench):
    parameters = dataclasses.replace(nominal_parameters(), masses=(9.0, 7.0), radii=(0.085, 0.055))
    start = bench.touching(parameters)
    moved = []
    for kind in (NOMINAL, MEASURED):
        with BulletPrior(kind) as shadow:
            moved.append(shadow.predict(start, bench.straight)[TARGET, 0] - start[TARGET, 0])
    assert abs(moved[0] - moved[1]) > 1e-3
