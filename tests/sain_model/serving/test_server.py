from dataclasses import replace
from time import sleep

import numpy as np
import pytest

from sain_core.errors import (
    ConfigError,
    ModelUnavailableError,
    TooMuchWorkError,
)
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.push import PushLimits
from sain_core.scene import make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.identify import with_all_parameters
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import Origin, SainDynamics
from sain_model.inference.kinds import MASS_RATIO, friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import choose_device
from sain_model.physics.parameters import AXES
from sain_model.physics.planar import PlanarPrior
from sain_model.serving import server as server_module
from sain_model.serving.server import ModelServer, load_server
from sain_model.serving.service import RECENT, ServiceRecord, ServingConfig

SCENE = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
SCENES = np.stack([SCENE] * 6)
PUSHES = PushLimits().sample(np.random.default_rng(0), 6)


class Broken(Model):
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return np.full_like(scenes, np.nan)


@pytest.fixture
def sain() -> SainDynamics:
    kind = friction_kind(PlanarPrior(), infers=False)
    model = residual_model(InteractionNetwork(), kind, "planar")
    return replace(model, origin=Origin("residual", "planar", "abc", "{}"))


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


def past(friction: float, pushes: int = 4) -> PushHistory:
    scenes, actions = SCENES[:pushes], PUSHES[:pushes]
    after = PlanarPrior().step(scenes, actions, {"friction": np.full(pushes, friction)})
    return PushHistory(scenes, actions, after)


def test_a_model_serves_what_the_past_tells() -> None:
    sain = residual_model(InteractionNetwork(), friction_kind(PlanarPrior()), "planar")
    server = ModelServer(sain, ServingConfig(model="mine"))
    for truth in (0.2, 0.08, 0.08):
        history = past(truth)
        told = sain.condition(history)
        np.testing.assert_array_equal(
            server.predict(SCENES, PUSHES, history=history)[1], told.step(SCENES, PUSHES)
        )
        predicted = server.rollout(SCENE, PUSHES[:, None], history)
        np.testing.assert_array_equal(predicted[:, 0], told.step(SCENES, PUSHES))
        assert server.friction(history) == pytest.approx(truth, rel=0.05)
    assert server.friction(None) == server.friction(PushHistory.empty()) == 0.12
    np.testing.assert_array_equal(server.predict(SCENES, PUSHES)[1], sain.step(SCENES, PUSHES))


def test_what_is_too_much_is_refused_before_anything_is_computed() -> None:
    server = ModelServer(IdentityPrior(), ServingConfig(max_disks=3))
    crowd = np.ones((1, 4, 8))
    with pytest.raises(TooMuchWorkError, match="scenes of 4 disks; at most 3 are accepted"):
        server.predict(crowd, PUSHES[:1])
    with pytest.raises(TooMuchWorkError):
        server.rollout(crowd[0], PUSHES[:1, None])
    planar = ModelServer(load_dynamics("planar"), ServingConfig(max_work=8))
    with pytest.raises(TooMuchWorkError, match="61 predictions of 2 disks are 122 of work"):
        planar.friction(past(0.2, pushes=1))


@pytest.mark.parametrize(
    ("wanted", "found", "device"),
    [("auto", True, "cuda"), ("auto", False, "cpu"), ("cuda", True, "cuda")],
)
def test_the_device_is_what_is_wanted_and_there(
    monkeypatch: pytest.MonkeyPatch, sain: SainDynamics, wanted: str, found: bool, device: str
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: found)
    assert choose_device(wanted) == device
    server = ModelServer(sain, ServingConfig(device=wanted))
    assert server.description.device == device
    assert sain.network is not None and sain.network.device == "cpu"  # moving makes another one


def test_a_device_that_is_not_there_is_refused(
    monkeypatch: pytest.MonkeyPatch, sain: SainDynamics
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    with pytest.raises(ConfigError, match="device is 'cuda', but PyTorch finds no GPU"):
        ModelServer(sain, ServingConfig(device="cuda"))
    with pytest.raises(ConfigError, match="allowed: 'auto', 'cpu', 'cuda'"):
        ServingConfig(device="tpu")
    with pytest.raises(ConfigError, match="allowed: auto, cpu, cuda"):
        choose_device("tpu")


def test_a_model_is_loaded_and_tried_before_it_is_served(
    sain: SainDynamics, monkeypatch: pytest.MonkeyPatch
) -> None:
    models: dict[str, Model] = {"one": sain, "broken": Broken()}
    monkeypatch.setattr(server_module, "load_dynamics", models.__getitem__)
    server = load_server(ServingConfig(model="one", max_work=99))
    assert (server.description.model, server.config.max_work) == ("one", 99)
    np.testing.assert_array_equal(server.predict(SCENES, PUSHES)[1], sain.step(SCENES, PUSHES))
    with pytest.raises(ModelUnavailableError, match="model 'broken' predicts NaN or Inf"):
        load_server(ServingConfig(model="broken"))


class Slow(IdentityPrior):
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        sleep(0.004 * len(pushes))
        return scenes.copy()


class DisksOnly(Model):
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return scenes.copy()


def test_a_model_that_is_of_no_use_to_a_planner_replaces_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    models = {"one": IdentityPrior(), "slow": Slow(), "disks": DisksOnly()}
    monkeypatch.setattr(server_module, "load_dynamics", models.__getitem__)
    server = load_server(ServingConfig(model="one", max_work=9))
    with pytest.raises(ConfigError, match=r"'slow' takes . ms for a prediction; a planner needs"):
        server.with_model("slow")
    disks, bodies = Bodies.disks(2), Bodies.named(["t"])
    assert server.with_model("disks", disks).description.model == "disks"
    with pytest.raises(ConfigError, match="roles; the bodies are t: use a model"):
        server.with_model("disks", bodies)
    assert server.with_model("one", bodies).description.model == "one"


def test_a_served_model_infers_masses_that_are_not_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sain = residual_model(InteractionNetwork(), friction_kind(PlanarPrior(AXES)), "planar_axes")
    model = with_all_parameters(sain)
    monkeypatch.setattr(server_module, "load_dynamics", lambda name: model)
    weighed, measured = (
        load_server(ServingConfig(unknown=unknown)).knowing(past(0.12)) for unknown in ("mass", "")
    )
    assert isinstance(weighed, SainDynamics) and isinstance(measured, SainDynamics)
    assert weighed.spread(MASS_RATIO) > 0.0 == measured.spread(MASS_RATIO)
    with pytest.raises(TooMuchWorkError, match="1037 predictions of 2 disks"):
        load_server(ServingConfig(unknown="mass", max_work=1000)).knowing(past(0.12, pushes=1))
    with pytest.raises(ConfigError, match="unknown is 'weight'; allowed: mass, radius"):
        ServingConfig(unknown="weight")


def test_latency_and_queue_are_recorded() -> None:
    record = ServiceRecord()
    assert record.summary()["p95_ms"] == "0.0"
    for _ in range(3):
        record.take()
    for number in range(100):
        record.take()
        record.answer(0.001 * (number + 1), well=number % 10 > 0)
    assert (record.requests, record.failures) == (100, 10)
    assert (record.queue, record.longest_queue) == (3, 4)
    assert (record.percentile(0.5), record.percentile(0.95)) == (0.05, 0.095)
    told = record.summary()
    assert (told["p50_ms"], told["p95_ms"], told["longest_ms"]) == ("50.0", "95.0", "100.0")
    for _ in range(RECENT):
        record.take()
        record.answer(0.002, well=True)
    assert record.percentile(0.95) == 0.002
