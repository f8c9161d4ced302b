"""Friction is in the rows of an episode whose world the simulator told of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sain_bags.dataset.conversion import convert
from sain_model.data.dataset import load_dataset
from tests.sain_bags.driven import Drive, Parts


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


def test_what_is_repeated_tells_the_same_and_what_differs_tells_nothing(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record()
    driver = Drive(recording)
    for episode, frictions in ((1, (0.1, 0.1)), (2, (0.1, 0.2))):
        for friction in frictions:  # a split's head; a simulator that was started anew
            driver.world(episode, friction)
        driver.episode(episode, [episode])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    np.testing.assert_array_equal(told(tmp_path / "out"), [0.1, np.nan])


def test_another_graph_tells_nothing(record: Callable[..., Any], tmp_path: Path) -> None:
    recording = record()
    Drive(recording, Parts(namespace="/other")).world(1, 0.1)
    Drive(recording).episode(1, [1, 2])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    with np.load(tmp_path / "out" / "shard-00000.npz") as shard:
        assert not {"friction", "rim_friction", "tool_friction"} & set(shard)


def test_every_bag_has_its_own_numbers(record: Callable[..., Any], tmp_path: Path) -> None:
    bags = []
    for name, seed in (("told", 0), ("untold", 1)):
        recording = record(name)
        driver = Drive(recording, seed=seed)
        if name == "told":
            driver.world(1, 0.11)
        driver.episode(1, [1])
        recording.writer.close()
        bags.append(recording.writer.folder)
    convert(bags, tmp_path / "out")
    np.testing.assert_array_equal(told(tmp_path / "out"), [0.11, np.nan])
