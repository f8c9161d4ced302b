"""Folders of LeRobot that are damaged: the file is named, and what to do."""

import os
import shutil
from pathlib import Path

import pytest

os.environ["HF_HUB_OFFLINE"] = "1"

from sain_core import pretrained
from sain_core.errors import CheckpointError
from sain_core.policy import ACTION, GOAL, STATE, load_policy

SIZES = {STATE: (16,), GOAL: (10,), ACTION: (5,)}
FILES = (
    "config.json",
    "model.safetensors",
    "policy_postprocessor.json",
    "policy_postprocessor_step_0_unnormalizer_processor.safetensors",
    "policy_preprocessor.json",
    "policy_preprocessor_step_3_normalizer_processor.safetensors",
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an untrained policy."""
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    kinds = (FeatureType.STATE, FeatureType.ENV, FeatureType.ACTION)
    both = zip(SIZES.items(), kinds, strict=True)
    inputs = {key: PolicyFeature(kind, size) for (key, size), kind in both}
    outputs = {ACTION: inputs.pop(ACTION)}
    small = {"dim_model": 8, "n_heads": 1, "dim_feedforward": 8, "chunk_size": 1}
    config = ACTConfig(
        device="cpu", n_action_steps=1, input_features=inputs, output_features=outputs, **small
    )
    folder = tmp_path_factory.mktemp("made")
    ACTPolicy(config).save_pretrained(folder)
    stats = {k: {name: torch.ones(n) for name in ("mean", "std")} for k, n in SIZES.items()}
    for processor in make_pre_post_processors(config, dataset_stats=stats):
        processor.save_pretrained(folder)
    (folder / "train_config.json").write_text("{}")
    return folder


@pytest.fixture
def saved(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "saved"))


def test_a_whole_folder_is_a_policy(saved):
    assert {path.name for path in saved.iterdir()} == {*FILES, "train_config.json"}
    assert load_policy(str(saved)).features == {STATE: (16,), GOAL: (10,)}


def named(file: str) -> str:
    """Return how a file is named: LeRobot reads those of both processors together."""
    return r"/policy_\*" if file.startswith("policy") else f"/{file}"


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_missing_is_named(saved, name):
    (saved / name).unlink()
    told = f"{named(name)} is missing or damaged: .*; save or copy it again"
    if name == "config.json":
        told = " holds no config.json; give the folder that LeRobot saved"
    with pytest.raises(CheckpointError, match=f"{saved}{told}"):
        load_policy(str(saved))


@pytest.mark.parametrize("name", [*FILES, "train_config.json"])
def test_a_file_that_is_damaged_is_named(saved, name):
    path = saved / name
    whole = path.read_bytes()
    for content in (b"[1]", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(CheckpointError, match=f"{saved}{named(name)} is missing or damaged: "):
            load_policy(str(saved))


def test_what_does_not_fit_together_is_no_policy(saved):
    config = saved / "config.json"
    whole = config.read_text()
    for old, new, text in (
        ('"act"', '"nobody"', r"config\.json is missing or damaged: .*'nobody'"),
        ('"dim_model": 8', '"dim_model": 16', r"model\.safetensors is .*size mismatch"),
    ):
        assert old in whole
        config.write_text(whole.replace(old, new))
        with pytest.raises(CheckpointError, match=text):
            load_policy(str(saved))


def test_a_library_that_a_kind_of_policy_needs_is_no_damage(saved, monkeypatch):
    def lacking(*given):
        raise ImportError("install transformers")

    monkeypatch.setattr("lerobot.policies.factory.get_policy_class", lacking)
    with pytest.raises(ImportError, match="install transformers"):
        pretrained.load(str(saved))
