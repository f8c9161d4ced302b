"""Another model while requests come in: none is lost; unsound ones are refused."""

import json
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.guarding.ros.reception import SERVICE
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.push import PushLimits
from sain_core.ros import codec
from sain_core.types import Pushes, Scenes
from sain_interfaces.srv import DescribeModel, LoadModel, Rollout
from sain_model.dynamics.load import ModelCard, save_checkpoint
from sain_model.ros.model_node import ModelNode
from sain_model.serving import server
from tests.sain_model.conftest import SCENE, random_network

SEQUENCES = PushLimits().sample(np.random.default_rng(0), 40).reshape(20, 2, 5)


def make_checkpoint(path: Path, seed: int) -> str:
    network = random_network(0.3, seed, hidden=8, message=4)
    save_checkpoint(path, network.weights, ModelCard("planar", {}, {}))
    return str(path)


def request() -> Rollout.Request:
    made = Rollout.Request(samples=20, horizon=2, disks=2)
    made.scene, made.pushes = codec.encode_floats(SCENE), codec.encode_floats(SEQUENCES)
    return made


def answers_of(*paths: str) -> dict[str, bytes]:
    """Return what each checkpoint answers, by its hash."""
    models = [load_dynamics(path) for path in paths]
    return {model.origin.model_hash: model.rollout(SCENE, SEQUENCES).tobytes() for model in models}


def set_model(graph: Any, name: str) -> Any:
    asked = SetParameters.Request(parameters=[Parameter("model", value=name).to_parameter_msg()])
    return graph.call(SetParameters, "model_node/set_parameters", asked).results[0]


@pytest.fixture
def first(tmp_path):
    return make_checkpoint(tmp_path / "first.safetensors", 1)


@pytest.fixture
def second(tmp_path):
    return make_checkpoint(tmp_path / "second.safetensors", 2)


class Stream:
    """Asks the same again and again, so many requests at a time."""

    def __init__(self, graph: Any, width: int) -> None:
        self.graph = graph
        self.client = graph.bystander.create_client(Rollout, "rollout", qos_profile=SERVICE)
        graph.wait(self.client.service_is_ready, "the service")
        self.asked: list[Any] = []  # futures, in the order of asking
        self.answered: list[Rollout.Response] = []  # in the order of the answers
        self.open = True
        for _ in range(width):
            self.ask()

    def ask(self) -> None:
        self.asked.append(self.client.call_async(request()))
        self.asked[-1].add_done_callback(self.take)

    def take(self, future: Any) -> None:
        self.answered.append(future.result())
        if self.open:
            self.ask()

    def run(self, more: int) -> None:
        """Let so many more be answered."""
        until = len(self.answered) + more
        self.graph.wait(lambda: len(self.answered) >= until, f"answer {until}")

    def finish(self) -> None:
        self.open = False
        everything = len(self.asked)
        self.graph.wait(lambda: len(self.answered) == everything, f"all {everything} answers")


def test_a_stream_of_requests_goes_on_through_swaps(graph, first, second):
    node = graph.start(ModelNode, model=first)
    expected = answers_of(first, second)
    assert len(set(expected.values())) == 2
    stream = Stream(graph, 12)  # more at a time than the middleware keeps by default
    for path in (second, first, second):
        stream.run(5)
        loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model=path))
        assert (loaded.error_code, loaded.error_message) == (ErrorCode.OK, "")
        assert (loaded.model, loaded.model_hash) == (path, load_dynamics(path).origin.model_hash)
        assert node.get_parameter("model").value == path
    stream.run(5)
    assert set_model(graph, first).successful
    stream.run(5)
    stream.finish()
    for answer in stream.answered:
        assert answer.error_code == ErrorCode.OK
        predicted = wire.decode_rollout(answer, (20, 2, 2))
        assert predicted.tobytes() == expected[answer.model_hash]
    assert {answer.model_hash for answer in stream.answered} == set(expected)
    described = graph.call(DescribeModel, "describe_model", DescribeModel.Request())
    assert (described.model, described.model_hash) == (
        first,
        load_dynamics(first).origin.model_hash,
    )
    assert json.loads(described.card)["weights_sha256"] == described.model_hash


class Slow(Model):
    """Predicts when it may."""

    def __init__(self) -> None:
        self.begun, self.may = Event(), Event()

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        self.begun.set()
        assert self.may.wait(60)
        predicted = scenes.copy()
        predicted[..., 0] += 1.0
        return predicted


def test_more_requests_than_may_wait_are_refused(graph, monkeypatch):
    slow = Slow()
    slow.may.set()
    monkeypatch.setattr(server, "load_dynamics", lambda name: slow)
    graph.start(ModelNode, model="slow", max_queue=2)
    slow.may.clear()
    stream = Stream(graph, 4)
    stream.open = False
    stream.run(2)
    assert {answer.error_code for answer in stream.answered} == {ErrorCode.BUSY}
    assert "2 requests are waiting already" in stream.answered[0].error_message
    slow.may.set()
    stream.finish()
    assert [answer.error_code for answer in stream.answered[2:]] == [ErrorCode.OK] * 2


def test_requests_are_answered_while_a_model_loads(graph, monkeypatch):
    may = Event()

    def load(name: str) -> IdentityPrior:
        assert name == "now" or may.wait(60)
        return IdentityPrior()

    monkeypatch.setattr(server, "load_dynamics", load)
    graph.start(ModelNode, model="now")
    client = graph.bystander.create_client(LoadModel, "load_model")
    graph.wait(client.service_is_ready, "the service")
    loading = client.call_async(LoadModel.Request(model="later"))
    answers = [graph.call(Rollout, "rollout", request()) for _ in range(3)]
    assert [answer.model for answer in answers] == ["now"] * 3
    assert not loading.done()
    may.set()
    graph.wait(loading.done, "the model")
    assert graph.call(Rollout, "rollout", request()).model == "later"


def test_a_bad_checkpoint_is_refused_and_the_old_one_goes_on(graph, first, tmp_path):
    reason = "truncated, changed"  # more: dynamics/test_checkpoint.py
    node = graph.start(ModelNode, model=first)
    bad = tmp_path / "bad.safetensors"
    make_checkpoint(bad, 3)
    bad.write_bytes(bad.read_bytes()[:-50])
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model=str(bad)))
    assert loaded.error_code == ErrorCode.CHECKPOINT and reason in loaded.error_message
    assert (loaded.model, loaded.model_hash) == (first, load_dynamics(first).origin.model_hash)
    result = set_model(graph, str(bad))
    assert not result.successful and reason in result.reason
    assert node.get_parameter("model").value == first
    assert graph.call(Rollout, "rollout", request()).model == first


def test_a_model_of_no_known_name_and_one_that_predicts_nan_are_refused(graph, monkeypatch):
    class Broken(IdentityPrior):
        def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
            return np.full_like(scenes, np.nan)

    graph.start(ModelNode, model="planar")
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model="planer"))
    assert ErrorCode(loaded.error_code) is ErrorCode.CONFIG
    assert "did you mean 'planar'" in loaded.error_message
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model=5000 * "a/"))
    assert ErrorCode(loaded.error_code) is ErrorCode.CONFIG
    assert loaded.error_message.endswith("the model has 10000 characters; allowed: 4096")
    monkeypatch.setattr(server, "load_dynamics", lambda name: Broken())
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model="broken"))
    assert ErrorCode(loaded.error_code) is ErrorCode.MODEL_UNAVAILABLE
    assert "predicts NaN or Inf" in loaded.error_message
    assert graph.call(Rollout, "rollout", request()).model == "planar"
