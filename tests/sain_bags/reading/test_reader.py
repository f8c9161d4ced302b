"""Damage is noticed wherever it is; nothing damaged passes for data."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sain_bags.reading.reader import Bag
from sain_core.errors import DatasetError


def read_all(path: Path) -> int:
    bag = Bag(path)
    bag.check()
    return len(list(bag.messages()))


def test_every_flipped_bit_is_noticed(episode_bag: Path) -> None:
    file = episode_bag / "bag_0.mcap"
    content = file.read_bytes()
    unnoticed = []
    for place in range(0, len(content), 211):
        damaged = bytearray(content)
        damaged[place] ^= 1 << (place % 8)
        file.write_bytes(damaged)
        try:
            read_all(episode_bag)
            unnoticed.append(place)
        except DatasetError:
            pass
    assert not unnoticed


def test_a_bag_that_was_not_closed_says_so(record: Callable[..., Any]) -> None:
    recording = record()
    recording.add("/sain/scene", "Scene")
    with pytest.raises(DatasetError, match=r"was not closed.*recover"):
        Bag(recording.writer.folder)


def test_what_is_no_bag_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # whoever is in another folder sees which
    with pytest.raises(DatasetError, match=f"no bag at {tmp_path / 'nowhere'}$"):
        Bag(Path("nowhere"))
    with pytest.raises(DatasetError, match="is an empty folder"):
        Bag(tmp_path)
    (tmp_path / "text.mcap").write_text("not an MCAP file, but long enough to have been one")
    with pytest.raises(DatasetError, match=r"text\.mcap is a text file"):
        Bag(tmp_path / "text.mcap")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rosbag2: [", "line 2"),
        ("", "it lacks the key 'rosbag2_bagfile_information'"),
        ("- 1", "it lacks the key 'rosbag2_bagfile_information'"),
        ("a: 1", "it lacks the key 'rosbag2_bagfile_information'"),
    ],
)
def test_unreadable_metadata_names_the_cure(text: str, said: str, episode_bag: Path) -> None:
    (episode_bag / "metadata.yaml").write_text(text)
    with pytest.raises(DatasetError, match=f"cannot be read .{said}.*ros2 bag reindex"):
        Bag(episode_bag)
