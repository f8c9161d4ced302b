"""A data set is whole or not called so; nothing that stands is lost or mixed with another."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sain_bags.dataset import conversion
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.dataset_folder import CARD_FILE, IDENTITY_FILE
from sain_bags.dataset.rows import ConversionConfig
from sain_core.errors import DatasetError, OutputError
from sain_core.output import MANIFEST
from tests.sain_bags.driven import Drive

IDS = range(1, 8)


@pytest.fixture
def bag(record: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bag of seven pushes, which makes three shards of up to three."""
    monkeypatch.setattr(conversion, "SHARD_SIZE", 3)
    recording = record()
    Drive(recording).episode(1, IDS)
    recording.writer.close()
    return Path(recording.writer.folder)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != MANIFEST}


def test_a_stopped_conversion_goes_on_to_the_same_bytes(bag: Path, tmp_path: Path) -> None:
    convert([bag], tmp_path / "whole")

    def stop(read: int, messages: int, rows: int) -> None:
        if rows == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert([bag], tmp_path / "out", progress=stop)
    assert sorted(contents(tmp_path / "out")) == ["conversion.json", "shard-00000.npz"]
    (tmp_path / "out" / ".shard-00001.npz.77.partial").write_bytes(b"killed while writing")
    written = (tmp_path / "out" / "shard-00000.npz").stat().st_mtime_ns
    convert([bag], tmp_path / "out")
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")
    assert (tmp_path / "out" / "shard-00000.npz").stat().st_mtime_ns == written


def test_another_conversion_needs_to_be_told_to_overwrite(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    convert([bag], out)
    before = contents(out)
    settings = ConversionConfig(prior="identity")
    with pytest.raises(OutputError, match=r"prior = 'planar', not 'identity'.*--overwrite"):
        convert([bag], out, settings)
    assert contents(out) == before
    convert([bag], out, settings, overwrite=True)
    assert b'"prior": "identity"' in contents(out)["conversion.json"]


def test_a_conversion_that_fails_overwrites_nothing(
    bag: Path, record: Callable[..., Any], tmp_path: Path
) -> None:
    convert([bag], tmp_path / "out")
    before = contents(tmp_path / "out")
    recording = record("refusals")
    driver = Drive(recording)
    here = driver.scene_message(1, driver.random_scene())
    driver.result(driver.push_message(1, 1), here, here, 9)
    recording.writer.close()
    with pytest.raises(
        DatasetError, match=r"no transition is left: 1 refused \(.*: push 1 of episode 1: "
    ):
        convert([recording.writer.folder], tmp_path / "out", overwrite=True)
    assert contents(tmp_path / "out") == before


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_of_something_else_is_left_alone(
    overwrite: bool, bag: Path, tmp_path: Path
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "shard-00000.npz").write_bytes(b"a collection of a week")
    with pytest.raises(OutputError, match=r"no conversion.json says that a conversion made them"):
        convert([bag], tmp_path / "mine", overwrite=overwrite)
    assert contents(tmp_path / "mine") == {"shard-00000.npz": b"a collection of a week"}


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(path.read_bytes()[:-40]),
        lambda path: np.savez(path, **{**np.load(path), "step": np.zeros(3, dtype=np.int64)}),
    ],
)
def test_a_shard_that_is_not_as_it_was_written_is_noticed(
    damage: Callable[[Path], Any], bag: Path, tmp_path: Path
) -> None:
    convert([bag], tmp_path / "out")
    whole = contents(tmp_path / "out")
    damage(tmp_path / "out" / "shard-00001.npz")
    with pytest.raises(OutputError, match=r"shard-00001.npz was changed since .*--overwrite"):
        convert([bag], tmp_path / "out")
    convert([bag], tmp_path / "out", overwrite=True)
    assert contents(tmp_path / "out") == whole


def test_another_recording_is_named_without_its_hash(
    bag: Path, record: Callable[..., Any], tmp_path: Path
) -> None:
    convert([bag], tmp_path / "out")
    other = record("other")
    Drive(other).episode(1, range(1, 3))
    other.writer.close()
    with pytest.raises(OutputError, match=r"holds another conversion \(of other recordings\); "):
        convert([other.writer.folder], tmp_path / "out")


def test_a_conversion_that_was_killed_at_its_first_file_goes_on(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / f".{IDENTITY_FILE}.123.partial").write_text("{")
    (out / ".sain-files").touch()
    convert([bag], out)
    assert (out / CARD_FILE).is_file()
    assert not [*out.glob("*.partial")]
