"""Data sets of every format: their split, and that nothing half-written passes for whole."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sain_bags.dataset import dataset_folder
from sain_core.errors import OutputError

os.environ["HF_HUB_OFFLINE"] = "1"  # before the libraries are imported: nothing here asks a hub

from pyarrow import parquet

from sain_bags.dataset.formats import MADE, FormatName
from sain_core.errors import ConfigError
from sain_core.output import MANIFEST
from sain_core.transitions import PARTS
from sain_model.data.dataset import load_dataset, split_by_episode
from tests.sain_bags.dataset.formats.exported import card_of, drive, to
from tests.sain_bags.driven import Drive, Parts

OTHERS: list[FormatName] = [name for name in MADE if name != "npz"]


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != MANIFEST)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_the_split_is_the_one_that_train_draws(
    record: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bags = [drive(record), drive(record, "more", seed=1)]
    split = split_by_episode(load_dataset(to("npz", bags, tmp_path / "npz")), 0, 0.1, 0.15)
    wanted = {part: sorted(set(getattr(split, part).alike.episode.tolist())) for part in PARTS}
    told = card_of(tmp_path / "npz")["split"]
    assert told["episodes"] == {part: wanted[part] for part in ("validation", "test")}
    assert told["transitions"] == {part: len(getattr(split, part)) for part in PARTS}
    out = to("parquet", bags, tmp_path / "parquet")
    for part in PARTS:
        found = parquet.read_table(out / f"{part}-00000.parquet")["episode"]
        assert sorted(set(found.to_pylist())) == wanted[part]


@pytest.mark.parametrize("name", OTHERS)
def test_numbers_of_disks_become_data_sets_of_their_own(
    name: FormatName, record: Callable[..., Any], tmp_path: Path
) -> None:
    bags = [tmp_path / "one", tmp_path / "bag", tmp_path / "three"]
    for disks, folder in enumerate(bags, 1):
        recording = record(folder.name)
        Drive(recording, Parts(disks=disks)).episode(1, [1, 2])
        recording.writer.close()
    out = to(name, bags, tmp_path / "out")
    assert sorted(path.name for path in out.iterdir() if path.name != MANIFEST) == [
        "card.json", "conversion.json", "disks-1", "disks-2", "disks-3",
    ]  # fmt: skip
    for disks in (1, 2, 3):
        part = out / f"disks-{disks}"
        if name == "parquet":
            states = parquet.read_table(next(part.iterdir()))["state"][0].as_py()
        else:
            from sain_bags.dataset.formats.to_lerobot import STATE, LeRobotDataset

            read = LeRobotDataset("pushes", root=part)
            states = read[0][STATE]
            assert len(read.features[STATE]["names"]) == 8 * disks
        assert len(states) == 8 * disks


@pytest.mark.parametrize("name", OTHERS)
def test_a_stop_while_writing_costs_nothing_and_same_recordings_give_same_bytes(
    name: FormatName, bag: Path, tmp_path: Path
) -> None:
    def stop(rows: int, of: int) -> None:
        if rows > of / 2:
            raise KeyboardInterrupt

    whole, stopped = to(name, bag, tmp_path / "whole" / "out"), tmp_path / "stopped" / "out"
    with pytest.raises(KeyboardInterrupt):
        to(name, bag, stopped, writing=stop)
    assert not (stopped / "card.json").exists()
    assert not any(path for pattern in MADE[name] for path in stopped.glob(pattern))
    gathered = {path: path.stat().st_mtime_ns for path in (stopped / ".rows").iterdir()}
    assert len(gathered) == 3 + 1  # with their manifest
    (stopped / ".export.partial").mkdir()  # of one that was killed
    (stopped / ".export.partial" / "data").write_bytes(b"half")

    def unchanged(rows: int, of: int) -> None:
        assert {path: path.stat().st_mtime_ns for path in gathered} == gathered

    to(name, bag, stopped, writing=unchanged)
    assert contents(stopped) == contents(whole)


@pytest.mark.parametrize("name", ["parquet", "lerobot"])
def test_overwriting_removes_only_what_a_conversion_wrote(
    name: FormatName, record: Callable[..., Any], bag: Path, tmp_path: Path
) -> None:
    recording = record("three")
    Drive(recording, Parts(disks=3)).episode(1, [1, 2])
    recording.writer.close()
    out = to(name, [bag, recording.writer.folder], tmp_path / "out")
    mine = [
        "disks-2/mine.txt", "data/mine.txt", "disks-3/data/mine.hdf5", "shard-mine.npz",
        "mine.partial", ".rows/mine", ".mine.partial", "train-mine.parquet", "disks-mine/a",
    ]  # fmt: skip
    for path in (out / mine_too for mine_too in mine):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("the only copy")
    to("npz", bag, out, overwrite=True)
    shards = [f"shard-{index:05d}.npz" for index in range(3)]
    assert sorted(contents(out)) == sorted(["card.json", "conversion.json", *mine, *shards])
    assert all((out / path).read_text() == "the only copy" for path in mine)
    to(name, bag, out, overwrite=True)
    assert set(mine) < set(contents(out)) and not list(out.glob("shard-0*"))


@pytest.mark.parametrize(("name", "library"), [("parquet", "pyarrow"), ("lerobot", "lerobot")])
def test_a_library_that_is_missing_is_named_before_anything_is_read(
    name: FormatName, library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bag: Path
) -> None:
    for module in [module for module in sys.modules if module.partition(".")[0] == library]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, library, None)
    for module in (f"sain_bags.dataset.formats.to_{name}", "sain_core.pretrained"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(
        ConfigError, match=rf"--format {name} needs {library}.*pip install '.\[{name}\]'"
    ):
        to(name, bag, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_full_disk_leaves_no_data_set(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(rows: Any, folder: Path) -> None:
        folder.mkdir()
        (folder / "train-00000.parquet").write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(dataset_folder, "find_format", lambda name: full)
    with pytest.raises(OutputError, match=r"cannot write .*No space left on device"):
        to("parquet", bag, tmp_path / "out")
    monkeypatch.undo()
    assert [path.name for path in (tmp_path / "out").iterdir()] == [MANIFEST]
