import numpy as np
import pytest

from sain_core.dynamics import IdentityPrior
from sain_core.errors import InvalidInputError, ModelUnavailableError, TooMuchWorkError
from sain_core.history import PushHistory
from sain_core.push import PushLimits
from sain_core.scene import make_scene, wrap_angle
from sain_core.types import Pushes, Scenes
from sain_model.friction import FrictionConfig
from sain_model.network import InteractionNetwork
from sain_model.planar import PlanarPrior
from sain_model.sain import SainDynamics
from sain_model.serving import ModelServer, ServingConfig

SCENE = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
SCENES = np.stack([SCENE] * 6)
PUSHES = PushLimits().sample(np.random.default_rng(0), 6)


class Broken:
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return np.full_like(scenes, np.nan)


@pytest.fixture
def sain() -> SainDynamics:
    return SainDynamics(InteractionNetwork(), PlanarPrior(), "planar", "abc", "{}")


def test_next_state_is_physics_plus_residual(sain: SainDynamics) -> None:
    server = ModelServer(sain, ServingConfig(model="mine"))
    physics = PlanarPrior().step(SCENES, PUSHES)
    residual, next_state = server.predict(SCENES, PUSHES)
    np.testing.assert_array_equal(next_state, sain.step(SCENES, PUSHES))
    difference = next_state - physics
    difference[..., 2] = wrap_angle(difference[..., 2])
    np.testing.assert_array_equal(residual, difference)
    given = server.predict(SCENES, PUSHES, physics)
    np.testing.assert_array_equal(given[1], next_state)


def test_a_model_is_described(sain: SainDynamics) -> None:
    description = ModelServer(sain, ServingConfig(model="mine")).description
    told = (description.model, description.kind, description.prior, description.model_hash)
    assert told == ("mine", "residual", "planar", "abc")
    identity = ModelServer(IdentityPrior(), ServingConfig(model="identity")).description
    assert (identity.kind, identity.prior, identity.card) == ("physics", "identity", "")


def test_too_much_work_is_refused() -> None:
    server = ModelServer(IdentityPrior(), ServingConfig(max_work=11))
    with pytest.raises(TooMuchWorkError, match="6 predictions of 2 disks are 12 of work"):
        server.predict(SCENES, PUSHES)
    with pytest.raises(TooMuchWorkError):
        server.rollout(SCENE, PUSHES.reshape(3, 2, 3))
    assert server.rollout(SCENE, PUSHES[:5, None]).shape == (5, 1, 2, 8)


def test_a_model_that_predicts_nan_is_unavailable() -> None:
    server = ModelServer(Broken(), ServingConfig(model="broken"))
    with pytest.raises(ModelUnavailableError, match="model 'broken' predicts NaN or Inf"):
        server.rollout(SCENE, PUSHES[:, None])
    with pytest.raises(ModelUnavailableError):
        server.predict(SCENES, PUSHES)


def test_a_scene_that_cannot_exist_is_refused() -> None:
    server = ModelServer(IdentityPrior(), ServingConfig())
    overlapping = SCENE.copy()
    overlapping[1, 0] = 0.45
    with pytest.raises(InvalidInputError, match="disks 0 and 1 overlap"):
        server.rollout(overlapping, PUSHES[:, None])


def past(friction: float, pushes: int = 4) -> PushHistory:
    scenes, actions = SCENES[:pushes], PUSHES[:pushes]
    after = PlanarPrior().step(scenes, actions, np.full(pushes, friction))
    return PushHistory(scenes, actions, after)


def test_a_model_serves_what_the_past_tells() -> None:
    sain = SainDynamics(InteractionNetwork(), PlanarPrior(), "planar", friction=FrictionConfig())
    server = ModelServer(sain, ServingConfig(model="mine"))
    for truth in (0.2, 0.08, 0.08):
        history = past(truth)
        told = sain.with_history(history)
        np.testing.assert_array_equal(
            server.predict(SCENES, PUSHES, history=history)[1], told.step(SCENES, PUSHES)
        )
        predicted = server.rollout(SCENE, PUSHES[:, None], history)
        np.testing.assert_array_equal(predicted[:, 0], told.step(SCENES, PUSHES))
        assert server.friction(history) == pytest.approx(truth, rel=0.05)
    assert server.friction(None) == server.friction(PushHistory.empty()) == 0.12
    np.testing.assert_array_equal(server.predict(SCENES, PUSHES)[1], sain.step(SCENES, PUSHES))


def test_a_past_is_bounded_work_and_may_be_of_no_use() -> None:
    server = ModelServer(IdentityPrior(), ServingConfig(max_work=7))
    assert server.friction(past(0.2, pushes=3)) == 0.0
    with pytest.raises(TooMuchWorkError, match="4 predictions of 2 disks are 8 of work"):
        server.rollout(SCENE, PUSHES[:1, None], past(0.2))
