from dataclasses import replace
from time import sleep

import numpy as np
import pytest

from sain_core.errors import ConfigError, InvalidInputError, TooMuchWorkError
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.push import PushLimits
from sain_core.scene import wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.identify import with_all_parameters
from sain_model.dynamics.sain import Origin, SainDynamics, residual_model
from sain_model.inference.kinds import MASS_RATIO, friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.parameters import AXES
from sain_model.physics.planar import PlanarPrior
from sain_model.serving import server as server_module
from sain_model.serving.server import ModelServer, load_server
from sain_model.serving.service import ServingConfig
from tests.sain_model.conftest import SCENE

SCENES = np.stack([SCENE] * 6)
PUSHES = PushLimits().sample(np.random.default_rng(0), 6)


@pytest.fixture
def sain():
    kind = friction_kind(PlanarPrior(), infers=False)
    model = residual_model(InteractionNetwork().weights, kind, "planar")
    return replace(model, origin=Origin("residual", "planar", "abc", "{}"))


def test_next_state_is_physics_plus_residual(sain):
    server = ModelServer(sain, ServingConfig(model="mine"))
    physics = PlanarPrior().step(SCENES, PUSHES)
    residual, next_state = server.predict(SCENES, PUSHES)
    np.testing.assert_array_equal(next_state, sain.step(SCENES, PUSHES))
    difference = next_state - physics
    difference[..., 2] = wrap_angle(difference[..., 2])
    np.testing.assert_array_equal(residual, difference)
    given = server.predict(SCENES, PUSHES, physics)
    np.testing.assert_array_equal(given[1], next_state)
    physics[..., 6] = 3.0
    with pytest.raises(InvalidInputError, match="physics_next states other masses or radii"):
        server.predict(SCENES, PUSHES, physics)


def past(friction: float, pushes: int = 4) -> PushHistory:
    scenes, actions = SCENES[:pushes], PUSHES[:pushes]
    after = PlanarPrior().step(scenes, actions, {"friction": np.full(pushes, friction)})
    return PushHistory(scenes, actions, after)


def test_what_is_too_much_is_refused_before_anything_is_computed():
    server = ModelServer(IdentityPrior(), ServingConfig(max_disks=3))
    crowd = np.ones((1, 4, 8))
    with pytest.raises(TooMuchWorkError, match="scenes of 4 disks; at most 3 are accepted"):
        server.predict(crowd, PUSHES[:1])
    with pytest.raises(TooMuchWorkError):
        server.rollout(crowd[0], PUSHES[:1, None])
    planar = ModelServer(load_dynamics("planar"), ServingConfig(max_work=8))
    with pytest.raises(TooMuchWorkError, match="61 predictions of 2 disks are 122 of work"):
        planar.friction(past(0.2, pushes=1))


class Slow(IdentityPrior):
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        sleep(0.004 * len(pushes))
        return scenes.copy()


class DisksOnly(Model):
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return scenes.copy()


def test_a_model_that_is_of_no_use_to_a_planner_replaces_no_other(monkeypatch):
    models = {"one": IdentityPrior(), "slow": Slow(), "disks": DisksOnly()}
    monkeypatch.setattr(server_module, "load_dynamics", models.__getitem__)
    server = load_server(ServingConfig(model="one", max_work=9))
    with pytest.raises(ConfigError, match=r"'slow' takes . ms for a prediction; a planner needs"):
        server.with_model("slow")
    disks, bodies = Bodies.disks(2), Bodies.named(["t"])
    assert server.with_model("disks", disks).name == "disks"
    with pytest.raises(ConfigError, match="roles; the bodies are t: use a model"):
        server.with_model("disks", bodies)
    assert server.with_model("one", bodies).name == "one"


def test_a_served_model_infers_masses_that_are_not_measured(monkeypatch):
    sain = residual_model(
        InteractionNetwork().weights, friction_kind(PlanarPrior(AXES)), "planar_axes"
    )
    model = with_all_parameters(sain)
    monkeypatch.setattr(server_module, "load_dynamics", lambda name: model)
    weighed, measured = (
        load_server(ServingConfig(unknown=unknown)).knowing(past(0.12)) for unknown in ("mass", "")
    )
    assert isinstance(weighed, SainDynamics) and isinstance(measured, SainDynamics)
    assert weighed.spread(MASS_RATIO) > 0.0 == measured.spread(MASS_RATIO)
    with pytest.raises(TooMuchWorkError, match="1037 predictions of 2 disks"):
        load_server(ServingConfig(unknown="mass", max_work=1000)).knowing(past(0.12, pushes=1))
    with pytest.raises(ConfigError, match="unknown is 'weight'; allowed: mass"):
        ServingConfig(unknown="weight")
