"""Friction is in the rows of an episode whose world the simulator told of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sain_bags.dataset.conversion import convert
from sain_model.data.dataset import load_dataset
from tests.sain_bags.driven import Drive


def told(out: Path, name: str = "friction") -> list[float]:
    with np.load(out / "shard-00000.npz") as shard:
        return shard[name].tolist()  # type: ignore[no-any-return]


def test_rows_have_the_friction_of_their_episode(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record()
    driver = Drive(recording)
    for episode, friction in ((1, 0.15), (2, None), (3, 0.09)):
        if friction:
            driver.world(episode, friction)
        driver.episode(episode, [10 * episode, 10 * episode + 1])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    expected = [0.15, 0.15, np.nan, np.nan, 0.09, 0.09]
    np.testing.assert_array_equal(load_dataset(tmp_path / "out").alike.friction, expected)
    np.testing.assert_array_equal(told(tmp_path / "out", "rim_friction"), 2 * np.array(expected))
    np.testing.assert_array_equal(told(tmp_path / "out", "tool_friction"), 3 * np.array(expected))
