"""Models that are not sound are refused, with the reason, and the one before goes on."""

import hashlib
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.model import IdentityPrior, load_dynamics
from sain_core.types import Pushes, Scenes
from sain_interfaces.srv import LoadModel, Rollout
from sain_model.dynamics.checkpoint import card_path
from sain_model.ros.model_node import ModelNode
from sain_model.serving import server
from tests.sain_model.ros.swapping import answers_of, make_checkpoint, request, set_model


@pytest.fixture
def first(tmp_path: Path) -> str:
    return make_checkpoint(tmp_path / "first.safetensors", 1)


class Canary:
    """Leaves a trace when it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return Path.touch, (self.trace,)


def edit_card(path: Path, **changes: object) -> None:
    card = json.loads(card_path(path).read_text())
    card_path(path).write_text(json.dumps(card | changes))


def rewrite(path: Path, content: bytes) -> None:
    """Replace the weights, and let the card vouch for them."""
    path.write_bytes(content)
    edit_card(path, weights_sha256=hashlib.sha256(content).hexdigest())


SPOILED: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (Path.unlink, "does not exist"),
    "cardless": (lambda path: card_path(path).unlink(), "does not exist"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-50]), "truncated, changed"),
    "cut": (lambda path: rewrite(path, path.read_bytes()[:-50]), "not a safetensors file"),
    "text": (lambda path: rewrite(path, b"not a checkpoint"), "not a safetensors file"),
    "pickle": (
        lambda path: rewrite(path, pickle.dumps(Canary(path.with_name("trace")))),
        "not a safetensors file",
    ),
    "torch": (
        lambda path: torch.save(Canary(path.with_name("trace")), path),
        "truncated, changed",
    ),
    "width": (
        lambda path: edit_card(path, network={"hidden": 16, "message": 4, "layers": 2}),
        "has shape",
    ),
    "version": (lambda path: edit_card(path, format_version=2), "has format 2; this version"),
    "features": (lambda path: edit_card(path, feature_version=99), "feature_version is 99"),
    "nesting": (
        lambda path: card_path(path).write_text("[" * 100_000),
        "is not a checkpoint's card",
    ),
}


@pytest.mark.parametrize("kind", sorted(SPOILED))
def test_a_bad_checkpoint_is_refused_and_the_old_one_goes_on(graph, first, tmp_path, kind):
    spoil, reason = SPOILED[kind]
    node = graph.start(ModelNode, model=first)
    bad = tmp_path / "bad.safetensors"
    make_checkpoint(bad, 3)
    spoil(bad)
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model=str(bad)))
    assert loaded.error_code == ErrorCode.CHECKPOINT
    assert reason in loaded.error_message
    assert (loaded.model, loaded.model_hash) == (first, load_dynamics(first).origin.model_hash)
    result = set_model(graph, str(bad))
    assert not result.successful
    assert reason in result.reason
    assert node.get_parameter("model").value == first
    answer = graph.call(Rollout, "rollout", request())
    predicted = wire.decode_rollout(answer, (20, 2, 2))
    assert predicted.tobytes() == answers_of(first)[answer.model_hash]
    assert not (tmp_path / "trace").exists()


def test_the_canary_sings_where_it_is_unpickled(tmp_path):
    pickle.loads(pickle.dumps(Canary(tmp_path / "trace")))
    assert (tmp_path / "trace").exists()


def test_a_model_of_no_known_name_and_one_that_predicts_nan_are_refused(graph, monkeypatch):
    class Broken(IdentityPrior):
        def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
            return np.full_like(scenes, np.nan)

    graph.start(ModelNode, model="planar")
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model="planer"))
    assert ErrorCode(loaded.error_code) is ErrorCode.CONFIG
    assert "did you mean 'planar'" in loaded.error_message
    monkeypatch.setattr(server, "load_dynamics", lambda name: Broken())
    loaded = graph.call(LoadModel, "load_model", LoadModel.Request(model="broken"))
    assert ErrorCode(loaded.error_code) is ErrorCode.MODEL_UNAVAILABLE
    assert "predicts NaN or Inf" in loaded.error_message
    assert graph.call(Rollout, "rollout", request()).model == "planar"


def test_other_parameters_stay_as_they_are(graph):
    graph.start(ModelNode, model="planar")
    parameter = Parameter("max_work", value=7).to_parameter_msg()
    asked = SetParameters.Request(parameters=[parameter])
    result = graph.call(SetParameters, "model_node/set_parameters", asked).results[0]
    assert not result.successful
    assert "read-only" in result.reason
