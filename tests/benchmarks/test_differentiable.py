"""The network alone in PyTorch: the same predictions, and slopes that differences confirm."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from benchmarks.differentiable import DifferentiableRollout
from sain_core.dynamics import IdentityPrior
from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import POSE, POSITION, THETA, make_scene, wrap_angle
from sain_core.types import Pushes, PushSequences, Scene, Scenes
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import IDENTITY
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior

Draw = Callable[[int, int], tuple[Scenes, Pushes]]


def network(**settings: str) -> InteractionNetwork:
    """A network that moves disks by centimetres."""
    torch.manual_seed(2)
    made = InteractionNetwork(NetworkConfig(hidden=16, message=8, **settings))
    with torch.no_grad():
        for parameter in made.parameters():
            parameter.copy_(0.4 * torch.randn_like(parameter))
    return made


@pytest.fixture
def learned() -> SainDynamics:
    return SainDynamics(network(), IdentityPrior(), IDENTITY)


@pytest.fixture(params=[2, 3], ids=["two disks", "three disks"])
def scene(request: pytest.FixtureRequest) -> Scene:
    places = np.array([[0.45, 0.0], [0.45, 0.141], [0.59, -0.02]])[: request.param]
    radii = np.array([0.08, 0.06, 0.055])[: request.param]
    return make_scene(places, np.full(request.param, 8.3), radii, np.arange(request.param) - 0.5)


def draw(count: int, horizon: int) -> PushSequences:
    pushes = PushLimits().sample(np.random.default_rng(4), count * horizon)
    return pushes.reshape(count, horizon, 3)


def test_it_predicts_what_the_model_predicts(learned: SainDynamics, scene: Scene) -> None:
    pushes = draw(50, 5)
    pushes[::3, 2, LENGTH] = 0.0
    expected = learned.rollout(scene, pushes)
    poses = DifferentiableRollout(learned).rollout(scene, torch.from_numpy(pushes)).numpy()
    moved = np.linalg.norm(np.diff(expected[..., POSITION], axis=1), axis=-1)
    assert np.median(moved) > 0.005
    np.testing.assert_allclose(poses[..., POSITION], expected[..., POSITION], atol=1e-5)
    turned = wrap_angle(poses[..., THETA] - expected[..., THETA])
    np.testing.assert_allclose(turned, 0.0, atol=1e-4)


def test_its_slopes_are_those_of_central_differences(learned: SainDynamics, scene: Scene) -> None:
    rollout = DifferentiableRollout(learned)
    pushes = draw(6, 3)
    weights = np.random.default_rng(5).standard_normal((6, 3, len(scene), 3))

    def value(sequences: PushSequences) -> np.ndarray:
        """Weigh what the model itself predicts, (K,)."""
        return (learned.rollout(scene, sequences)[..., POSE] * weights).sum(axis=(1, 2, 3))

    leaf = torch.from_numpy(pushes.copy()).requires_grad_()
    (rollout.rollout(scene, leaf) * torch.from_numpy(weights)).sum().backward()
    slopes = leaf.grad.numpy()
    step = 1e-3
    for push in range(3):
        for number in range(3):
            nudge = np.zeros((3, 3))
            nudge[push, number] = step
            differences = (value(pushes + nudge) - value(pushes - nudge)) / (2 * step)
            np.testing.assert_allclose(slopes[:, push, number], differences, rtol=0.02, atol=0.02)


def test_a_rest_has_no_slope(learned: SainDynamics, scene: Scene) -> None:
    pushes = draw(4, 3)
    pushes[:, 1, LENGTH] = 0.0
    leaf = torch.from_numpy(pushes).requires_grad_()
    DifferentiableRollout(learned).rollout(scene, leaf).sum().backward()
    assert (leaf.grad[:, 1] == 0.0).all() and (leaf.grad[:, [0, 2]] != 0.0).all()


def test_its_copy_leaves_the_model_as_it_was(learned: SainDynamics, scene: Scene) -> None:
    DifferentiableRollout(learned)
    for parameter in learned.network.parameters():
        assert parameter.dtype == torch.float32 and parameter.requires_grad


@pytest.mark.parametrize(
    ("sain", "message"),
    [
        (SainDynamics(network(), PlanarPrior(), "planar"), "residual network"),
        (SainDynamics(network(features="world"), IdentityPrior(), IDENTITY), "'world'"),
    ],
)
def test_models_that_it_does_not_fit_are_refused(sain: SainDynamics, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        DifferentiableRollout(sain)
