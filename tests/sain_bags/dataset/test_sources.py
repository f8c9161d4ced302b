"""What cannot be converted is named, with what is missing; several recordings stay apart."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sain_bags import commands
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.rows import ConversionConfig
from sain_bags.dataset.sources import find_sources
from sain_core.errors import DatasetError
from sain_model.data.dataset import load_dataset
from tests.sain_bags.driven import Drive, Parts

Start = Callable[..., Any]


def drive(record: Start, name: str = "bag", seed: int = 0, **parts: Any) -> Path:
    recording = record(name)
    driver = Drive(recording, Parts(**parts), seed)
    driver.episode(1, [1, 2])
    driver.episode(2, [3])
    recording.writer.close()
    return Path(recording.writer.folder)


def test_episodes_of_several_recordings_do_not_collide(record: Start, tmp_path: Path) -> None:
    bags = [drive(record, "first"), drive(record, "second", seed=1)]
    done = convert(bags, tmp_path / "out")
    data = load_dataset(tmp_path / "out").alike
    assert data.episode.tolist() == [0, 0, 1, 2, 2, 3]
    assert data.step.tolist() == [0, 1, 0, 0, 1, 0]
    assert (done.transitions, done.episodes) == (6, 4)


def test_a_simulator_that_was_started_anew_begins_other_episodes(
    record: Start, tmp_path: Path
) -> None:
    recording = record()
    for run in range(2):
        Drive(recording, seed=run).episode(1, [10 * run + 1, 10 * run + 2])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    data = load_dataset(tmp_path / "out").alike
    assert data.episode.tolist() == [0, 0, 1, 1]


def test_a_bag_below_a_folder_that_was_not_closed_is_not_passed_over(
    record: Start, tmp_path: Path
) -> None:
    drive(record, "runs/a/bag")
    (drive(record, "runs/b/bag", 1) / "metadata.yaml").unlink()
    with pytest.raises(DatasetError, match="runs/b/bag was not closed"):
        find_sources([tmp_path / "runs"])


def test_the_same_recording_twice_would_be_on_both_sides_of_a_split(record: Start) -> None:
    bag = drive(record)
    with pytest.raises(DatasetError, match=r"bag_0.mcap are the same recording; give it once"):
        find_sources([bag, bag / "bag_0.mcap"])


def test_what_is_missing_is_named(record: Start) -> None:
    recording = record()
    Drive(recording, Parts(results=False)).episode(1, [1])
    recording.writer.close()
    wanted = "no sain_interfaces/msg/PushResult; it has /"
    with pytest.raises(DatasetError, match=f"bag holds no pushes to learn from: {wanted}"):
        find_sources([recording.writer.folder])


def test_several_graphs_must_be_told_apart(record: Start, tmp_path: Path) -> None:
    recording = record()
    for seed, namespace in enumerate(("/left", "/right")):
        Drive(recording, Parts(namespace=namespace), seed).episode(1, range(2 + seed))
    recording.writer.close()
    bag = recording.writer.folder
    with pytest.raises(DatasetError, match="several graphs; choose one of /left, /right"):
        convert([bag], tmp_path / "out")
    with pytest.raises(DatasetError, match="no graph '/up'; it has /left, /right"):
        convert([bag], tmp_path / "out", ConversionConfig(namespace="/up"))
    right = convert([bag], tmp_path / "out", ConversionConfig(namespace="/right"))
    assert right.transitions == 3


def test_the_command_says_what_it_did(record: Start, tmp_path: Path, capfd: Any) -> None:
    bag = drive(record, still=(0,))
    arguments = [str(bag), "--out", str(tmp_path / "out"), "--moved-only"]
    assert commands.to_dataset(arguments) == 0
    said = capfd.readouterr().err
    assert "1 transitions of 1 episodes in" in said
    assert "left out: 2 target moved by less than 2 mm" in said
    assert commands.to_dataset([str(bag), "--out", str(tmp_path / "out")]) == 1
    assert "moved_only = True, not False" in capfd.readouterr().err
    assert commands.to_dataset(["--out", str(tmp_path / "new")]) == 1
    assert "no recording is given" in capfd.readouterr().err
