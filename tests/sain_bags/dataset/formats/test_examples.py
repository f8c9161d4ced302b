"""What docs/reference/formats.md shows is run as it stands there."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

os.environ["HF_HUB_OFFLINE"] = "1"  # before the libraries are imported: nothing here asks a hub

from sain_bags.dataset.conversion import convert
from sain_bags.dataset.formats import MADE
from sain_bags.dataset.rows import ConversionConfig
from tests.paths import ROOT
from tests.sain_bags.driven import Drive

PAGE = ROOT / "docs/reference/formats.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)


def test_every_format_has_an_example() -> None:
    assert len(EXAMPLES) == 4
    for name in MADE:
        assert any(f"data/{name}" in example for example in EXAMPLES), name


def test_examples_run_as_they_stand(
    record: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = record()
    driver = Drive(recording)
    for episode in range(1, 6):
        driver.episode(episode, [10 * episode + place for place in range(3)])
    recording.writer.close()
    for name in MADE:
        convert([tmp_path / "bag"], tmp_path / "data" / name, ConversionConfig(format=name))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("datasets.config.HF_DATASETS_CACHE", tmp_path / "cache")
    said: dict[str, Any] = {}
    for example in EXAMPLES:
        exec(compile(example, "docs/reference/formats.md", "exec"), said)
        if "states" in said and "shard" in said:
            assert said["states"].shape == (15, 2, 8)
            del said["states"], said["shard"]
    assert len(said["frame"]) > 10
    assert (len(said["test"]), said["test"].num_episodes) == (3, 1)
    assert len(said["same"]) == 3
