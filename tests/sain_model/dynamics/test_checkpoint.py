"""A checkpoint that is not sound is refused, with the file and what is wrong in the message."""

import hashlib
import json
import pickle
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.torch
import torch

from sain_core.errors import CheckpointError, ConfigError, OutputError
from sain_core.model import load_dynamics
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.load import ModelCard, card_path, load_checkpoint, save_checkpoint
from sain_model.dynamics.priors import make_prior, prior_settings
from sain_model.dynamics.sain import SainDynamics, residual_model
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from tests.sain_model.conftest import random_network

PRIOR = PlanarPrior(PlanarConfig(friction=0.15))


@pytest.fixture
def checkpoint(tmp_path):
    network = random_network(0.1, hidden=8, message=4)
    path = tmp_path / "model.safetensors"
    save_checkpoint(path, network.weights, ModelCard("planar", prior_settings(PRIOR), {}))
    return path


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


def retype(path: Path, value: torch.Tensor) -> None:
    tensors = safetensors.torch.load_file(path) | {"dynamics.0.bias": value}
    rewrite(path, safetensors.torch.save(tensors))


def test_what_was_saved_is_loaded_with_the_prior_it_had(checkpoint, random_pushes):
    sain = load_dynamics(str(checkpoint))
    assert isinstance(sain, SainDynamics) and sain.physics == PRIOR
    card = json.loads(sain.origin.card)
    assert NetworkConfig(**card["network"]) == NetworkConfig(hidden=8, message=4)
    assert card["weights_sha256"] == sain.origin.model_hash
    scenes, pushes = random_pushes(10, 0)
    weights = load_checkpoint(checkpoint).network.weights
    again = residual_model(weights, friction_kind(PRIOR, infers=False), "planar")
    np.testing.assert_array_equal(sain.step(scenes, pushes), again.step(scenes, pushes))
    assert sorted(p.suffix for p in checkpoint.parent.iterdir()) == [".json", ".safetensors"]


EMPTY: dict[str, Any] = asdict(Intervals())
HALF = torch.zeros(8, dtype=torch.float8_e4m3fn)
SPOILED: dict[str, tuple[Callable[[Path], object], str]] = {
    "gone": (Path.unlink, r"model\.safetensors does not exist"),
    "cardless": (lambda path: card_path(path).unlink(), r"model\.json does not exist"),
    "changed": (lambda path: path.write_bytes(path.read_bytes()[:-50]), "truncated, changed, or"),
    "cut": (lambda path: rewrite(path, path.read_bytes()[:-50]), "is not a safetensors file"),
    "pickle": (
        lambda path: rewrite(path, pickle.dumps(Canary(path.with_name("trace")))),
        "is not a safetensors file",
    ),
    "torch": (lambda path: torch.save(Canary(path.with_name("trace")), path), "truncated, changed"),
    "no card": (lambda path: card_path(path).write_text("{"), "is not a checkpoint's card"),
    "nested": (
        lambda path: card_path(path).write_text("[" * 100_000),
        "is not a checkpoint's card",
    ),
    "nan": (lambda path: retype(path, torch.full((8,), torch.nan)), "bias holds NaN or Inf"),
    "precision": (lambda path: retype(path, HALF), "is of type F8_E4M3; it must be float32"),
}


@pytest.mark.parametrize("kind", SPOILED)
def test_files_that_are_not_sound_are_refused_and_never_unpickled(checkpoint, kind):
    spoil, message = SPOILED[kind]
    spoil(checkpoint)
    with pytest.raises(CheckpointError, match=message):
        load_dynamics(str(checkpoint))
    trace = checkpoint.with_name("trace")
    assert not trace.exists()
    pickle.loads(pickle.dumps(Canary(trace)))
    assert trace.exists(), "the canary sings where it is unpickled"


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("color", "red", "is not a checkpoint's card: it has color, and no card has that"),
        ("format", 1, "has format 1; this version reads '0.2': train it again with: ros2 run"),
        ("weights_sha256", "0" * 64, "its card says 0000000000000000"),
        ("prior", "plain", "the prior 'plain' has no settings; given: friction, friction_scale"),
        ("prior_config", {"friction": -1.0}, "PlanarConfig.friction is -1.0"),
        ("prior_config", {"frictoin": 0.1}, "frictoin"),
        ("prior_config", {"friction": "0.1"}, "friction is '0.1'; it must be a number"),
        ("friction", {"width": "wide"}, "friction: could not convert string"),
        ("bottoms", ["wheels"], "bottoms has 'wheels'; allowed: feet, flat"),
        ("network", {"hidden": 9, "message": 4, "layers": 2}, r"tensor \S+ has shape"),
        ("network", {"hidden": 8, "message": 4, "members": 3}, r"tensor \S+ has shape"),
        ("network", {"hidden": "8"}, "network: hidden is '8'; it must be an integer"),
        ("network", {"features": "table"}, "features is 'table'; allowed: 'push', 'world'"),
        ("network", {"width": 8}, "width"),
        ("intervals", EMPTY | {"mid": {"factors": [1.0, 2.0]}}, "intervals: Region has scores"),
        (
            "intervals",
            EMPTY | {"mid": {"noise": "x"}},
            "intervals: noise is 'x'; it must be a nu",
        ),
        ("intervals", EMPTY | {"mid": {"way": -1.0}}, "Region.way is -1.0; it must be at least 0"),
        ("intervals", EMPTY | {"mid": 3}, "intervals: mid is 3; it must be"),
        ("intervals", {"mid": {}, "turn": {}}, "intervals: they lack level, target, places"),
        (
            "intervals",
            EMPTY | {"places": {"levels": [0.9]}},
            "Law has levels .* it needs 4",
        ),
    ],
)
def test_cards_that_are_not_sound_are_refused(checkpoint, field, value, message):
    edit_card(checkpoint, **{field: value})
    with pytest.raises(CheckpointError, match=message) as caught:
        load_dynamics(str(checkpoint))
    assert checkpoint.stem in str(caught.value)


def test_unknown_names_and_paths_are_refused(tmp_path):
    message = r"model 'plannar' is unknown \(did you mean 'planar'\?\); known: .*, planar_axes"
    for load in (load_dynamics, make_prior):
        with pytest.raises(ConfigError, match=message):
            load("plannar")
    with pytest.raises(CheckpointError, match="the prior 'bullet' has no settings; given: fri"):
        make_prior("bullet", {"friction": 0.1})
    blocker, card = tmp_path / "file", ModelCard("identity", {}, {})
    blocker.write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        save_checkpoint(blocker / "m.safetensors", InteractionNetwork().weights, card)
    with pytest.raises(CheckpointError, match=r"name ends in .safetensors"):
        save_checkpoint(tmp_path / "m.pt", InteractionNetwork().weights, card)
