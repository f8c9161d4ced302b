"""SAIN as a dynamics: frames, numbering, ensembles, and regions of any bodies."""

import numpy as np
import pytest

from sain_core.push import LENGTH
from sain_core.scene import POSITION, THETA, X, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_model.dynamics.intervals import Intervals, Law, Region
from sain_model.dynamics.sain import SainDynamics, residual_model, with_intervals
from sain_model.evaluation.errors import predict_with_history
from sain_model.inference.kinds import FRICTION, friction_kind
from sain_model.network.features import true_residual
from sain_model.network.interaction_network import InteractionNetwork, ensemble
from sain_model.physics.parameters import PlanarConfig
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import apply_residual, make_part, push_two_bodies, random_network
from tests.strokes import rotate_pushes, rotate_scenes

NARROW = {"hidden": 16, "message": 8}


def alone(network: InteractionNetwork, infers: bool = False) -> SainDynamics:
    return residual_model(network.weights, friction_kind(PlanarPrior(), infers), "planar")


@pytest.fixture
def sain():
    return alone(random_network(1.0, 1, **NARROW))


def test_turning_and_moving_scene_and_push_turns_and_moves_the_prediction(sain, random_pushes):
    scenes, pushes = random_pushes(50, 0)
    expected = sain.step(scenes, pushes)
    assert np.abs(expected - sain.physics.step(scenes, pushes)).max() > 1e-3
    turned = sain.step(rotate_scenes(scenes, 2.0), rotate_pushes(pushes, 2.0))
    away = rotate_scenes(expected, 2.0)
    np.testing.assert_allclose(turned[..., POSITION], away[..., POSITION], atol=2e-5)
    np.testing.assert_allclose(wrap_angle(turned[..., THETA] - away[..., THETA]), 0, atol=1e-3)
    moved = scenes.copy()
    moved[..., X] += 0.3
    expected[..., X] += 0.3
    after = sain.step(moved, pushes)
    np.testing.assert_allclose(after[..., POSITION], expected[..., POSITION], atol=2e-5)
    np.testing.assert_allclose(wrap_angle(after[..., THETA] - expected[..., THETA]), 0, atol=1e-3)


def test_renumbering_the_other_disks_renumbers_the_prediction(sain, random_pushes):
    positions = np.array([[0.45, 0.0], [0.591, 0.0], [0.5, 0.14], [0.5, -0.15]])
    scene = make_scene(
        positions, np.array([8.0, 7.0, 7.5, 8.5]), np.array([0.08, 0.06, 0.06, 0.06])
    )
    scenes = np.stack([scene] * 10)
    _, pushes = random_pushes(10, 4)
    order = [0, 1, 3, 2]
    np.testing.assert_allclose(
        sain.step(scenes[:, order], pushes), sain.step(scenes, pushes)[:, order], atol=1e-4
    )


def test_the_true_residual_makes_the_prediction_true(random_pushes):
    scenes, pushes = random_pushes(30, 0)
    physics = PlanarPrior().step(scenes, pushes)
    truth = physics.copy()
    truth[..., POSITION] += np.random.default_rng(0).normal(0, 0.01, truth[..., POSITION].shape)
    truth[..., THETA] = wrap_angle(truth[..., THETA] + 3.0)
    again = apply_residual(physics, pushes, true_residual(truth, pushes, physics))
    np.testing.assert_allclose(again[..., POSITION], truth[..., POSITION], atol=1e-12)
    np.testing.assert_allclose(wrap_angle(again[..., THETA] - truth[..., THETA]), 0, atol=1e-9)


def test_the_mean_is_what_step_predicts_and_the_spread_that_of_the_members(random_pushes):
    lone = [random_network(0.5, seed, **NARROW) for seed in range(3)]
    sain = alone(ensemble(lone))
    scenes, pushes = random_pushes(40, 0)
    pushes[:5, LENGTH] = 0.0
    prediction = sain.predict(scenes, pushes)
    np.testing.assert_array_equal(prediction.mean, sain.step(scenes, pushes))
    places = np.stack([alone(network).step(scenes, pushes) for network in lone])
    spread = np.sqrt(places[..., :2].var(axis=0, ddof=1).sum(axis=-1))
    np.testing.assert_allclose(prediction.members, spread, atol=1e-6)
    assert spread.max() > 1e-3 and (prediction.members[:5] == 0.0).all()
    assert prediction.radius is None
    assert (alone(lone[0]).predict(scenes, pushes).members == 0.0).all()


def test_what_is_not_known_of_the_friction_is_told_and_earlier_pushes_make_it_less(random_pushes):
    prior = PlanarPrior()
    sain = alone(random_network(0.5, **NARROW), infers=True)
    scenes, pushes = random_pushes(40, 1)
    first = sain.predict(scenes, pushes)
    assert sain.spread(FRICTION) == pytest.approx(0.5, rel=0.05)  # of the belief at the start
    seen = prior.step(scenes[:3], pushes[:3])
    known = sain.condition(PushHistory(scenes[:3], pushes[:3], seen))
    assert known.spread(FRICTION) < 0.5 * sain.spread(FRICTION)
    assert known.predict(scenes, pushes).friction.mean() < 0.5 * first.friction.mean()
    ends = [
        sain.step(scenes, pushes, {FRICTION: np.full(len(pushes), 0.12 * np.exp(way))})[..., :2]
        for way in (-sain.spread(FRICTION), sain.spread(FRICTION))
    ]
    expected = np.linalg.norm(ends[1] - ends[0], axis=-1) / 2
    np.testing.assert_allclose(first.friction, expected, atol=1e-12)


T_AND_STAR = Bodies.named(["t", "star"], ["pushable", "pushable"])


@pytest.fixture
def shaped():
    network = random_network(0.05, hidden=8, message=4, members=2)
    adapting = Intervals(mid=Region(scores=(1e-4,), factors=(2.0,)), places=Law(size=0.5))
    sain = with_intervals(alone(network, infers=True), adapting)
    return sain.with_bodies(T_AND_STAR)


def test_earlier_pushes_widen_regions_in_a_world_unlike_home(shaped):
    """In a graph, from the history, as in an evaluation, from the rows of an episode."""
    scenes, pushes = push_two_bodies(6, 1)
    after = PlanarPrior(PlanarConfig(friction=0.19)).with_bodies(T_AND_STAR).step(scenes, pushes)
    after[..., :2] += 0.02
    state, action, following = scenes[:5], pushes[:5], after[:5]
    told = shaped.condition(PushHistory(state, action, following))
    assert told.widening[0] > 2.0 * shaped.widening[0]
    nothing = shaped.condition(PushHistory(state[:0], action[:0], following[:0]))
    assert nothing.widening[0] == shaped.widening[0]
    radius = told.predict(scenes[5:], pushes[5:]).radius
    episode = make_part(scenes, pushes, after, np.zeros(6, np.int64), bodies=T_AND_STAR)
    rows = predict_with_history(shaped, episode)
    np.testing.assert_allclose(rows.radius[5:], radius, rtol=1e-6)
    first = shaped.predict(scenes[:1], pushes[:1]).radius
    np.testing.assert_allclose(rows.radius[:1], first, rtol=1e-6)
