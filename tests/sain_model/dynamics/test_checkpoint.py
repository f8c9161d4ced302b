"""A checkpoint that is not sound is refused, with the file and what is wrong in the message."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import torch

from sain_core.errors import CheckpointError, ConfigError, OutputError
from sain_core.model import load_dynamics
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.checkpoint import ModelCard, card_path, save_checkpoint
from sain_model.dynamics.load import load_checkpoint
from sain_model.dynamics.priors import make_prior, prior_settings
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior

Draw = Callable[[int, int], tuple[Scenes, Pushes]]


@pytest.fixture
def checkpoint(tmp_path: Path) -> Path:
    torch.manual_seed(0)
    network = InteractionNetwork(NetworkConfig(hidden=8, message=4))
    with torch.no_grad():
        network.dynamics[-1].bias.fill_(0.1)
    path = tmp_path / "model.safetensors"
    prior = PlanarPrior(PlanarConfig(friction=0.15))
    save_checkpoint(path, network, ModelCard("planar", prior_settings(prior), {}))
    return path


def edit_card(path: Path, **changes: object) -> None:
    card = json.loads(card_path(path).read_text())
    card_path(path).write_text(json.dumps(card | changes))


def rewrite(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    edit_card(path, weights_sha256=hashlib.sha256(content).hexdigest())


def refused(path: Path, message: str) -> None:
    with pytest.raises(CheckpointError, match=message) as caught:
        load_dynamics(str(path))
    assert path.stem in str(caught.value)


def test_what_was_saved_is_loaded_with_the_prior_it_had(
    checkpoint: Path, random_pushes: Draw
) -> None:
    sain = load_dynamics(str(checkpoint))
    assert isinstance(sain, SainDynamics)
    assert isinstance(sain.physics, PlanarPrior)
    assert sain.physics.config.friction == 0.15
    card = json.loads(sain.origin.card)
    assert card["network"] == {
        "hidden": 8,
        "message": 4,
        "layers": 2,
        "features": "push",
        "members": 1,
        "believed": False,
        "output": "residual",
        "places": 0,
    }
    assert card["weights_sha256"] == sain.origin.model_hash
    scenes, pushes = random_pushes(10, 0)
    network = load_checkpoint(checkpoint).network.module
    again = residual_model(
        network, friction_kind(PlanarPrior(PlanarConfig(friction=0.15)), infers=False), "planar"
    )
    np.testing.assert_array_equal(sain.step(scenes, pushes), again.step(scenes, pushes))
    assert sorted(p.name for p in checkpoint.parent.iterdir()) == [
        "model.json",
        "model.safetensors",
    ]


def test_missing(checkpoint: Path) -> None:
    refused(checkpoint.with_name("gone.safetensors"), "gone.safetensors does not exist")
    card_path(checkpoint).unlink()
    refused(checkpoint, "model.json does not exist")


def test_an_unknown_name() -> None:
    message = r"model 'plannar' is unknown \(did you mean 'planar'\?\); known: .*, planar_axes"
    for load in (load_dynamics, make_prior):
        with pytest.raises(ConfigError, match=message):
            load("plannar")
    with pytest.raises(
        CheckpointError, match="the prior 'bullet' has no settings; given: friction"
    ):
        make_prior("bullet", {"friction": 0.1})


def test_truncated(checkpoint: Path) -> None:
    content = checkpoint.read_bytes()
    checkpoint.write_bytes(content[: len(content) // 2])
    refused(checkpoint, "truncated, changed, or the card belongs to other weights")
    rewrite(checkpoint, content[: len(content) // 2])
    refused(checkpoint, "is not a safetensors file")


def test_not_safetensors(checkpoint: Path) -> None:
    rewrite(checkpoint, b"PK\x03\x04 a pickle, say")
    refused(checkpoint, "is not a safetensors file")


def test_a_card_that_is_none(checkpoint: Path) -> None:
    card_path(checkpoint).write_text("{")
    refused(checkpoint, "model.json is not a checkpoint's card")
    card_path(checkpoint).write_text('{"color": "red"}')
    refused(checkpoint, "model.json is not a checkpoint's card")


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("feature_version", 99, "feature_version is 99; this version reads 1"),
        ("format_version", 1, "has format 1; this version reads 3: train it again with: ros2 run"),
        ("weights_sha256", "0" * 64, "its card says 0000000000000000"),
        ("prior", "plain", "the prior 'plain' has no settings; given: friction, gravity"),
        ("prior_config", {"friction": -1.0}, "PlanarConfig.friction is -1.0"),
        ("prior_config", {"frictoin": 0.1}, "frictoin"),
        ("bottoms", ["wheels"], "bottoms has 'wheels'; allowed: feet, flat"),
        ("network", {"hidden": 9, "message": 4, "layers": 2}, r"tensor \S+ has shape"),
        ("network", {"hidden": 8, "message": 4, "layers": 3}, r"tensor \S+ has shape"),
        ("network", {"hidden": -8}, "NetworkConfig.hidden is -8"),
        ("network", {"width": 8}, "width"),
    ],
)
def test_another_architecture(checkpoint: Path, field: str, value: object, message: str) -> None:
    edit_card(checkpoint, **{field: value})
    refused(checkpoint, message)


def test_weights_that_are_not_finite(checkpoint: Path) -> None:
    tensors = safetensors.torch.load_file(checkpoint)
    tensors["dynamics.0.bias"][1] = torch.nan
    rewrite(checkpoint, safetensors.torch.save(tensors))
    refused(checkpoint, "tensor dynamics.0.bias holds NaN or Inf")


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        save_checkpoint(
            blocker / "m.safetensors", InteractionNetwork(), ModelCard("identity", {}, {})
        )
    with pytest.raises(CheckpointError, match=r"name ends in .safetensors"):
        save_checkpoint(tmp_path / "m.pt", InteractionNetwork(), ModelCard("identity", {}, {}))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("prior_config", {"friction": "0.1"}, "friction is '0.1'; it must be of type float"),
        ("prior_config", {"gravity": True}, "gravity is True; it must be of type float"),
        ("friction", {"width": "wide"}, "friction: could not convert string"),
    ],
)
def test_settings_of_the_wrong_type(
    checkpoint: Path, field: str, value: object, message: str
) -> None:
    edit_card(checkpoint, **{field: value})
    refused(checkpoint, message)


def test_weights_of_another_precision(checkpoint: Path) -> None:
    tensors = safetensors.torch.load_file(checkpoint)
    tensors["dynamics.0.bias"] = tensors["dynamics.0.bias"].to(torch.float8_e4m3fn)
    rewrite(checkpoint, safetensors.torch.save(tensors))
    refused(
        checkpoint, "tensor dynamics.0.bias is of type torch.float8_e4m3fn; it must be torch.fl"
    )
