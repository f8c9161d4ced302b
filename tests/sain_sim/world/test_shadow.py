import dataclasses

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.feasibility import Stroke
from sain_core.model import Model
from sain_core.push import PushLimits, idle_pushes
from sain_core.scene import MASS, MID, POSITION, RADIUS, TARGET, move_apart, surface_gaps
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.shadow import KINDS, MEASURED, NOMINAL, TRUE, BulletPrior, stand_back
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


def test_the_tool_goes_where_it_goes_in_the_truth(bench):
    small = dataclasses.replace(nominal_parameters(), radii=(0.075, 0.06))
    start = bench.touching(small)
    ends = []
    with BulletPrior(NOMINAL) as shadow:
        shadow.predict(start, bench.straight)
        ends.append(shadow._world.sample().tool[:2])
    with World(small) as world:
        world.reset(start)
        world.push(bench.straight)
        ends.append(world.sample().tool[:2])
    assert np.allclose(ends[0], ends[1], atol=1e-4)


def test_disks_that_grew_into_each_other_part_along_the_line_of_centres():
    scene = nominal_parameters(3).scene(np.array([[0.4, 0.0], [0.53, 0.0], [0.4, 0.13]]))
    apart = move_apart(scene)
    assert surface_gaps(apart).min() >= 0.0
    assert np.array_equal(apart[MID], scene[MID])
    assert np.allclose(apart[TARGET, POSITION], [0.54, 0.0])
    assert np.array_equal(move_apart(apart), apart)


def test_a_disk_that_grew_into_the_tool_sends_it_back_on_its_line():
    scene = nominal_parameters().scene(np.array([[0.4, 0.0], [0.6, 0.0]]))
    limits = PushLimits()
    inside = Stroke(np.array([0.32, 0.01]), np.array([0.42, 0.01]), 0.0)
    back = stand_back(inside, scene, limits)
    assert np.isclose(np.hypot(*(back.start - [0.4, 0.0])), 0.08 + limits.tool_radius)
    assert back.start[1] == 0.01 and back.start[0] < 0.32
    assert np.array_equal(back.end, inside.end)
    outside = Stroke(np.array([0.30, 0.0]), np.array([0.42, 0.0]), 0.0)
    assert stand_back(outside, scene, limits) is outside


def test_a_shadow_that_cannot_be_is_refused():
    with pytest.raises(ConfigError, match="kind of shadow is 'real'; allowed: nominal, measured"):
        BulletPrior("real")
    with pytest.raises(ConfigError, match="needs the parameters of the truth"):
        BulletPrior(TRUE)
