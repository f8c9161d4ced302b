# ruff: noqa: E501 - a case is a line
"""The model's node: right answers to right questions, and codes and messages to wrong ones."""

from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Time

from sain_core import wire
from sain_core.errors import CheckpointError, ConfigError, ErrorCode
from sain_core.model import load_dynamics
from sain_core.push import PushLimits
from sain_core.ros import codec
from sain_core.ros.qos import LATCHED
from sain_core.scene import RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.transitions import PushHistory
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_interfaces.srv import PredictResidual, Rollout
from sain_model.physics.planar import PlanarPrior
from sain_model.ros.model_node import ModelNode
from tests.sain_model.conftest import SCENE


def pushes(*shape):
    count = int(np.prod(shape))
    return PushLimits().sample(np.random.default_rng(0), count).reshape(*shape, 5)


def rollout_request(sequences, **fields):
    samples, horizon, _ = sequences.shape
    request = Rollout.Request(samples=samples, horizon=horizon, disks=len(SCENE))
    request.scene, request.pushes = codec.encode_floats(SCENE), codec.encode_floats(sequences)
    for name, value in fields.items():
        setattr(request, name, value)
    return request


@pytest.fixture
def model(graph):
    return graph.start(ModelNode, model="planar", max_work=1000)


def test_a_rollout_is_the_model_s_own_to_the_last_bit(graph, model):
    sequences = pushes(16, 3)
    response = graph.call(Rollout, "rollout", rollout_request(sequences))
    assert (response.error_code, response.error_message) == (ErrorCode.OK, "")
    predicted = wire.decode_rollout(response, (16, 3, 2))
    expected = PlanarPrior().rollout(SCENE, sequences)
    np.testing.assert_array_equal(predicted, expected)
    assert response.model == "planar"
    assert response.compute_time > 0


def test_a_rollout_tells_how_sure_the_model_is_when_asked(graph):
    graph.start(ModelNode, model="sain")
    sequences = pushes(4, 3)
    sure = graph.call(Rollout, "rollout", rollout_request(sequences, with_regions=True))
    regions = np.array(sure.regions).reshape(4, 3, 2)
    sain = load_dynamics("sain")
    expected = sain.regions(SCENE, sequences, sain.rollout(SCENE, sequences))
    np.testing.assert_array_equal(regions, expected)
    assert (regions > 0.0).all()
    assert not graph.call(Rollout, "rollout", rollout_request(sequences)).regions


@pytest.mark.parametrize(
    ("fields", "code", "text"),
    [
        ({"samples": 0}, ErrorCode.INVALID, "samples is 0; it must be at least 1"),
        ({"samples": 5}, ErrorCode.INVALID, "pushes has 20 numbers; 50 were expected"),
        ({"scene": [np.nan] * 16}, ErrorCode.INVALID, "scene at (0, 0) is nan; must be finite"),
        ({"scene": [0.0] * 16}, ErrorCode.INVALID, "mass of disk 0 is 0.0; it must be positive"),
        ({"pushes": [0, 0, 0.0, 9.0, 0.2] * 4}, ErrorCode.OUT_OF_RANGE, "length of push (0, 0) is 9.0"),
        ({"disks": 33, "scene": [0.5] * 264}, ErrorCode.TOO_MUCH_WORK, "scenes of 33 disks; at most 32"),
        ({"past": 1}, ErrorCode.INVALID, "past_scenes has 0 numbers; 16 were expected"),
    ],
)  # fmt: skip
def test_a_wrong_rollout_request_is_answered_with_what_is_wrong(graph, model, fields, code, text):
    request = rollout_request(pushes(2, 2), **fields)
    response = graph.call(Rollout, "rollout", request)
    assert ErrorCode(response.error_code) is code
    assert text in response.error_message
    assert len(response.predicted) == 0
    good = graph.call(Rollout, "rollout", rollout_request(pushes(2, 2)))
    assert good.error_code == ErrorCode.OK


def test_a_shape_of_a_user_is_the_one_that_the_graph_states(graph, model):
    """It is installed nowhere: a bodies file names the outline by its path."""
    own = replace(get_shape("t"), name="mug-123456")
    stated, plates = Bodies((own, get_shape("disk"))), Bodies.named(("t", "disk"))
    request = rollout_request(pushes(4, 2), shapes=["mug-123456", "disk"])
    refused = graph.call(Rollout, "rollout", request)
    assert "shape of body 0 is 'mug-123456'" in refused.error_message
    message = codec.encode_bodies(stated, SCENE[:, RADIUS], stamp=Time(), episode_id=1)
    graph.bystander.create_publisher(BodiesMessage, "shapes", LATCHED).publish(message)
    graph.wait(lambda: model.bodies.shapes[0].name == own.name, "the bodies at the model")
    answered = graph.call(Rollout, "rollout", request)
    assert answered.error_message == ""
    expected = PlanarPrior(bodies=plates).rollout(SCENE, pushes(4, 2))
    np.testing.assert_allclose(wire.decode_rollout(answered, (4, 2, 2)), expected, atol=1e-6)


def history(friction, count=3):
    scenes, actions = np.stack([SCENE] * count), pushes(count)
    after = PlanarPrior().step(scenes, actions, {"friction": np.full(count, friction)})
    return PushHistory(scenes, actions, after)


def test_earlier_pushes_tell_the_service_the_friction(graph, model):
    past, sequences = history(0.18), pushes(4, 2)
    request = rollout_request(sequences)
    codec.fill_past(request, past)
    response = graph.call(Rollout, "rollout", request)
    assert (response.error_code, response.error_message) == (ErrorCode.OK, "")
    assert response.friction == pytest.approx(0.18, rel=0.05)
    told = load_dynamics("planar").condition(past).rollout(SCENE, sequences)
    np.testing.assert_array_equal(wire.decode_rollout(response, (4, 2, 2)), told)
    without = graph.call(Rollout, "rollout", rollout_request(sequences))
    assert without.friction == 0.12

    request = PredictResidual.Request(batch=1, disks=2)
    request.scenes, request.pushes = codec.encode_floats(SCENE), codec.encode_floats(pushes(1))
    codec.fill_past(request, past)
    response = graph.call(PredictResidual, "predict_residual", request)
    assert response.friction == pytest.approx(0.18, rel=0.05)


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("planer", ConfigError, "did you mean 'planar'"),
        ("/nowhere/model.safetensors", CheckpointError, "/nowhere/model.safetensors"),
    ],
)
def test_a_model_that_is_not_there_is_refused_at_the_start(graph, name, error, text):
    with pytest.raises(error, match=text):
        graph.start(ModelNode, model=name)
