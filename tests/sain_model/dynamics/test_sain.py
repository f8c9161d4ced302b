"""Features, network and SAIN as a dynamics: frames, numbering, and what a residual may touch."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from sain_core.errors import InvalidInputError
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.push import LENGTH, rotate_pushes
from sain_core.scene import (
    MASS,
    POSITION,
    THETA,
    VELOCITY,
    X,
    make_scene,
    rotate_scenes,
    wrap_angle,
)
from sain_core.types import Pushes, Scenes
from sain_model.compute.batch_checks import check_physics_next
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import friction_kind
from sain_model.network.features import apply_residual, true_residual
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior

Draw = Callable[[int, int], tuple[Scenes, Pushes]]


def wild_network() -> InteractionNetwork:
    """A network whose residuals are large, so that a law that fails shows."""
    torch.manual_seed(1)
    network = InteractionNetwork(NetworkConfig(hidden=16, message=8))
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.copy_(torch.randn_like(parameter))
    return network


@pytest.fixture
def sain() -> SainDynamics:
    return residual_model(wild_network(), friction_kind(PlanarPrior(), infers=False), "planar")


def test_a_new_network_leaves_the_prior_as_it_is(random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(20, 0)
    prior = PlanarPrior()
    sain = residual_model(InteractionNetwork(), friction_kind(prior, infers=False), "planar")
    assert isinstance(sain, Model)
    np.testing.assert_allclose(sain.step(scenes, pushes), prior.step(scenes, pushes), atol=1e-12)


def test_turning_and_moving_scene_and_push_turns_and_moves_the_prediction(
    sain: SainDynamics, random_pushes: Draw
) -> None:
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
    np.testing.assert_allclose(sain.step(moved, pushes), expected, atol=2e-5)


def test_renumbering_the_other_disks_renumbers_the_prediction(
    sain: SainDynamics, random_pushes: Draw
) -> None:
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


def test_a_far_disk_changes_nothing_for_the_others(sain: SainDynamics, random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(30, 2)
    far = scenes[:, 1:].copy()
    far[..., X] += 2.0
    more = sain.step(np.concatenate([scenes, far], axis=1), pushes)
    np.testing.assert_allclose(more[:, :2], sain.step(scenes, pushes), atol=1e-6)


def test_a_push_of_no_length_changes_not_a_bit(sain: SainDynamics, random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(10, 0)
    pushes[:5, LENGTH] = 0.0
    after = sain.step(scenes, pushes)
    assert after[:5].tobytes() == scenes[:5].tobytes()
    assert (after[5:] != scenes[5:]).any()


def test_a_residual_moves_poses_alone(sain: SainDynamics, random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(30, 0)
    after = sain.step(scenes, pushes)
    np.testing.assert_array_equal(after[..., MASS:], scenes[..., MASS:])
    np.testing.assert_array_equal(after[..., VELOCITY], 0.0)
    assert (np.abs(after[..., THETA]) <= np.pi).all()
    assert after.dtype == np.float64


def test_the_true_residual_makes_the_prediction_true(random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(30, 0)
    physics = PlanarPrior().step(scenes, pushes)
    truth = physics.copy()
    truth[..., POSITION] += np.random.default_rng(0).normal(0, 0.01, truth[..., POSITION].shape)
    truth[..., THETA] = wrap_angle(truth[..., THETA] + 3.0)
    again = apply_residual(physics, pushes, true_residual(truth, pushes, physics))
    np.testing.assert_allclose(again[..., POSITION], truth[..., POSITION], atol=1e-12)
    np.testing.assert_allclose(wrap_angle(again[..., THETA] - truth[..., THETA]), 0, atol=1e-9)


def test_kinds_are_told_by_the_prior() -> None:
    network = InteractionNetwork()
    for prior, name, kind in (
        (PlanarPrior(), "planar", "residual"),
        (IdentityPrior(), "identity", "learned"),
    ):
        model = residual_model(network, friction_kind(prior, infers=False), name)
        assert model.origin.kind == kind


def test_a_prediction_of_other_scenes_cannot_be_corrected(random_pushes: Draw) -> None:
    scenes, _ = random_pushes(3, 0)
    with pytest.raises(InvalidInputError, match=r"physics_next has shape \(3, 2, 8\) like the sce"):
        check_physics_next(scenes, np.concatenate([scenes, scenes[:, :1]], axis=1))


def test_the_shipped_checkpoint_corrects_but_little(random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(200, 9)
    sain = load_dynamics("sain")
    assert isinstance(sain, SainDynamics)
    change = sain.step(scenes, pushes) - sain.physics.step(scenes, pushes)
    distance = np.linalg.norm(change[..., POSITION], axis=-1)
    # Its prior errs by a fraction of a millimetre once it knows the friction.
    assert 1e-5 < distance.mean() < 1e-3
    assert distance.max() < 0.02
