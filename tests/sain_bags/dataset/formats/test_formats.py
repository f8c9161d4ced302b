"""Every format, read back by its own library, holds what the npz shards of the same bag hold."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy import ndarray

os.environ["HF_HUB_OFFLINE"] = "1"  # before the libraries are imported: nothing here asks a hub

import datasets
import minari
import pandas
import polars
import pyarrow
from pyarrow import parquet

from sain_bags.dataset import conversion, dataset_folder
from sain_bags.dataset.conversion import ConversionConfig, convert
from sain_bags.dataset.formats import MADE, FormatName
from sain_bags.dataset.formats.to_lerobot import GOAL, STATE, TASK, LeRobotDataset
from sain_core.dataset import PARTS
from sain_core.errors import ConfigError, OutputError
from sain_model.data.dataset import load_transitions, split_by_episode
from tests.sain_bags.driven import Drive, Parts

OTHERS: list[FormatName] = [name for name in MADE if name != "npz"]
EPISODES = 5
Rows = dict[str, ndarray]


def drive(
    record: Callable[..., Any], name: str = "bag", parts: Parts = Parts(), seed: int = 0
) -> Path:
    """Record episodes of five pushes; the third of each is left out, being unsettled."""
    recording = record(name)
    driver = Drive(recording, parts, seed)
    for episode in range(1, EPISODES + 1):
        first = 10 * episode + (2**63 if episode == 2 else 0)  # ids are any of 64 bits
        driver.episode(episode, range(first, first + 5))
    recording.writer.close()
    return Path(recording.writer.folder)


@pytest.fixture
def bag(record: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bag whose episodes stand in more than one shard, and have gaps."""
    monkeypatch.setattr(conversion, "SHARD_SIZE", 7)
    return drive(record, parts=Parts(unsettled=(2,)))


@pytest.fixture
def rows(bag: Path, tmp_path: Path) -> Rows:
    """The rows of the bag as npz shards have them."""
    convert([bag], tmp_path / "npz")
    return read_npz(tmp_path / "npz")


def read_npz(folder: Path) -> Rows:
    shards = [dict(np.load(path)) for path in sorted(folder.glob("shard-*.npz"))]
    return {key: np.concatenate([shard[key] for shard in shards]) for key in shards[0]}


def to(name: FormatName, bags: Path | list[Path], out: Path, **more: Any) -> Path:
    convert(bags if isinstance(bags, list) else [bags], out, ConversionConfig(format=name), **more)
    return out


def in_order(rows: Rows, card: dict[str, Any]) -> Rows:
    """Return rows with the parts of the split one after another, as a card says what they are."""
    named = card["split"]["episodes"]
    held = {part: np.isin(rows["episode"], named.get(part, [])) for part in PARTS}
    held["train"] = ~(held["validation"] | held["test"])
    order = np.concatenate([np.flatnonzero(held[part]) for part in PARTS])
    return {key: values[order] for key, values in rows.items()} | {
        "split": np.repeat(PARTS, [int(held[part].sum()) for part in PARTS])
    }


def card_of(folder: Path) -> dict[str, Any]:
    card: dict[str, Any] = json.loads((folder / "card.json").read_text())
    return card


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def assert_same(found: Any, wanted: ndarray, key: str) -> None:
    """Compare values to the bit."""
    np.testing.assert_array_equal(np.array(list(found), dtype=wanted.dtype), wanted, key)


def test_parquet_is_read_back_by_pandas_polars_and_datasets(
    bag: Path, rows: Rows, tmp_path: Path
) -> None:
    out = to("parquet", bag, tmp_path / "out")
    wanted = in_order(rows, card_of(out))
    wanted["disks"] = np.full(len(rows["episode"]), 2)
    files = [str(out / f"{part}-00000.parquet") for part in PARTS]
    read = {
        "pyarrow": parquet.read_table(files).to_pandas(),
        "pandas": pandas.concat([pandas.read_parquet(file) for file in files]),
        "polars": polars.read_parquet(files),
        "datasets": datasets.load_dataset(
            "parquet", data_files=files, split="train", cache_dir=str(tmp_path / "cache")
        ),
    }
    for name, table in read.items():
        for key, values in wanted.items():
            assert_same(table[key], values, f"{key} by {name}")
        assert set(wanted) == set(getattr(table, "column_names", None) or table.columns), name


def test_datasets_knows_the_split_of_a_folder(bag: Path, tmp_path: Path) -> None:
    out = to("parquet", bag, tmp_path / "out")
    found = datasets.load_dataset(str(out), cache_dir=str(tmp_path / "cache"))
    assert {part: len(found[part]) for part in PARTS} == card_of(out)["split"]["transitions"]


def test_parquet_has_the_types_and_the_card_in_its_schema(bag: Path, tmp_path: Path) -> None:
    out = to("parquet", bag, tmp_path / "out")
    schema = parquet.read_schema(out / "train-00000.parquet")
    assert schema.field("state").type == pyarrow.list_(pyarrow.float64(), 16)
    assert schema.field("action").type == pyarrow.list_(pyarrow.float64(), 3)
    assert schema.field("stamp").type == pyarrow.int64()
    assert schema.field("push_id").type == pyarrow.uint64()
    assert schema.field("moved").type == pyarrow.bool_()
    assert json.loads(schema.metadata[b"sain"]) == card_of(out)


def test_parquet_goes_on_in_another_file(
    bag: Path, rows: Rows, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sain_bags.dataset.formats import to_parquet

    monkeypatch.setattr(to_parquet, "CHUNKS", 2)
    out = to("parquet", bag, tmp_path / "out")
    files = sorted(out.glob("train-*.parquet"))
    assert len(files) == 2
    found = np.concatenate([parquet.read_table(path)["push_id"] for path in files])
    train = in_order(rows, card_of(out))
    np.testing.assert_array_equal(found, train["push_id"][train["split"] == "train"])


def test_minari_is_read_back_by_minari(bag: Path, rows: Rows, tmp_path: Path) -> None:
    out = to("minari", bag, tmp_path / "out")
    wanted = in_order(rows, card_of(out))
    data = minari.MinariDataset(out / "data")
    first = 0
    for episode in data:
        part = slice(first, first := first + len(episode))
        assert_same(episode.observations[:-1], wanted["state"][part], "observations")
        assert_same(episode.observations[-1:], wanted["next_state"][part][-1:], "the last one")
        assert_same(episode.actions, wanted["action"][part], "actions")
        target, goal = wanted["next_state"][part][:, 8:10], wanted["goal"][part]
        np.testing.assert_allclose(episode.rewards, -np.hypot(*(target - goal).T), rtol=1e-14)
        assert not episode.terminations.any()
        assert episode.truncations.tolist() == [*[False] * (len(episode) - 1), True]
        assert episode.infos.keys() == rows.keys() - {"state", "action"}
        for key, values in episode.infos.items():
            assert len(values) == len(episode) + 1, key
            texts = [text.decode() for text in values[1:]] if values.dtype == object else values[1:]
            assert_same(texts, wanted[key][part], key)
        assert all(data.observation_space.contains(state) for state in episode.observations)
        assert all(data.action_space.contains(push) for push in episode.actions)
    assert first == data.total_steps == len(rows["episode"])
    assert data.total_episodes == 2 * EPISODES  # the unsettled push breaks each in two
    splits = data.storage.metadata["splits"]
    for part, (begin, end) in splits.items():
        held = minari.MinariDataset(out / "data", episode_indices=np.arange(begin, end))
        found = [number for episode in held for number in episode.infos["push_id"][1:].tolist()]
        assert found == wanted["push_id"][wanted["split"] == part].tolist()


def test_minari_finds_a_data_set_by_its_name(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    to("minari", bag, tmp_path / "pushes-v3")
    assert minari.load_dataset("pushes-v3").id == "pushes-v3"
    assert list(minari.list_local_datasets()) == ["pushes-v3"]
    assert minari.MinariDataset(to("minari", bag, tmp_path / "mine") / "data").id


def test_lerobot_is_read_back_by_lerobot(bag: Path, rows: Rows, tmp_path: Path) -> None:
    out = to("lerobot", bag, tmp_path / "out")
    wanted = in_order(rows, card_of(out))
    data = LeRobotDataset("pushes", root=out)
    assert (data.num_frames, data.num_episodes, data.fps) == (len(rows["episode"]), 2 * EPISODES, 1)
    exact = data.hf_dataset.with_format(None)
    renamed = {"state": STATE, "next_state": "next.state"}
    for key in rows.keys() - {"goal", "tolerance"}:
        values = exact[renamed.get(key, key)]
        if wanted[key].dtype == np.uint64:  # of which LeRobot has none
            values = np.array(list(values)).view(np.uint64)
        assert_same(values, wanted[key], key)
    goals = np.column_stack([wanted["goal"], wanted["tolerance"]])
    assert_same(exact[GOAL], goals, GOAL)
    distance = np.linalg.norm(wanted["next_state"][:, 8:10] - wanted["goal"], axis=1)
    np.testing.assert_allclose(exact["next.reward"], -distance, rtol=1e-14)
    assert exact["next.done"][:] == [False, True] * (2 * EPISODES)  # two pushes, the gap, two more
    assert not any(exact["next.success"])
    frame = data[3]
    assert frame["task"] == TASK
    np.testing.assert_array_equal(frame["action"], wanted["action"][3].astype(np.float32))
    assert (frame["timestamp"], frame["frame_index"], frame["episode_index"]) == (1.0, 1, 1)
    names = data.features[STATE]["names"]
    assert (names[0], names[8], len(names)) == ("mid_x", "target_x", 16)
    np.testing.assert_allclose(data.meta.stats["action"]["mean"], wanted["action"].mean(axis=0))
    for part, span in data.meta.info["splits"].items():
        held = LeRobotDataset("pushes", root=out, episodes=list(range(*map(int, span.split(":")))))
        ids = np.array([int(number) for number in held.hf_dataset["push_id"]]).view(np.uint64)
        assert ids.tolist() == wanted["push_id"][wanted["split"] == part].tolist()


def test_the_split_is_the_one_that_train_draws(
    record: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bags = [drive(record), drive(record, "more", seed=1)]
    split = split_by_episode(load_transitions(to("npz", bags, tmp_path / "npz")), 0, 0.1, 0.15)
    wanted = {part: sorted(set(getattr(split, part).episode.tolist())) for part in PARTS}
    told = card_of(tmp_path / "npz")["split"]
    assert told["episodes"] == {part: wanted[part] for part in ("validation", "test")}
    assert told["transitions"] == {part: len(getattr(split, part)) for part in PARTS}
    out = to("parquet", bags, tmp_path / "parquet")
    for part in PARTS:
        found = parquet.read_table(out / f"{part}-00000.parquet")["episode"]
        assert sorted(set(found.to_pylist())) == wanted[part]


def test_too_few_episodes_are_all_to_train_on(record: Callable[..., Any], tmp_path: Path) -> None:
    recording = record()
    Drive(recording).episode(1, [1, 2])
    recording.writer.close()
    out = to("parquet", recording.writer.folder, tmp_path / "out")
    assert card_of(out)["split"]["transitions"] == {"train": 2, "validation": 0, "test": 0}
    assert [path.name for path in out.glob("*.parquet")] == ["train-00000.parquet"]


@pytest.mark.parametrize("name", OTHERS)
def test_numbers_of_disks_become_data_sets_of_their_own(
    name: FormatName, record: Callable[..., Any], tmp_path: Path
) -> None:
    bags = [tmp_path / "bag", tmp_path / "three"]
    for disks, folder in enumerate(bags, 2):
        recording = record(folder.name)
        Drive(recording, Parts(disks=disks)).episode(1, [1, 2])
        recording.writer.close()
    out = to(name, bags, tmp_path / "out")
    assert sorted(path.name for path in out.iterdir()) == [
        "card.json", "conversion.json", "disks-2", "disks-3",
    ]  # fmt: skip
    for disks in (2, 3):
        part = out / f"disks-{disks}"
        if name == "parquet":
            states = parquet.read_table(part / "train-00000.parquet")["state"][0].as_py()
        elif name == "minari":
            states = minari.MinariDataset(part / "data")[0].observations[0]
        else:
            states = LeRobotDataset("pushes", root=part)[0][STATE]
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
    assert len(gathered) == 3
    (stopped / ".export.partial" / "of an earlier one").write_bytes(b"killed while writing")

    def unchanged(rows: int, of: int) -> None:
        assert {path: path.stat().st_mtime_ns for path in gathered} == gathered

    to(name, bag, stopped, writing=unchanged)
    assert contents(stopped) == contents(whole)


def test_a_data_set_that_is_whole_is_made_again_to_the_same_bytes(
    bag: Path, tmp_path: Path
) -> None:
    out = to("parquet", bag, tmp_path / "out")
    before = contents(out)
    (out / "train-00007.parquet").write_bytes(b"of a longer one")
    assert contents(to("parquet", bag, out)) == before


@pytest.mark.parametrize("name", OTHERS)
def test_another_format_needs_to_be_told_to_overwrite(
    name: FormatName, bag: Path, rows: Rows, tmp_path: Path
) -> None:
    out = to(name, bag, tmp_path / "out")
    (out / "notes.txt").write_text("mine")
    before = contents(out)
    with pytest.raises(OutputError, match=rf"format = '{name}', not 'npz'.*--overwrite"):
        to("npz", bag, out)
    assert contents(out) == before
    to("npz", bag, out, overwrite=True)
    shards = [f"shard-{index:05d}.npz" for index in range(3)]
    assert sorted(contents(out)) == ["card.json", "conversion.json", "notes.txt", *shards]
    assert (out / "notes.txt").read_text() == "mine"


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
    assert not (tmp_path / "out" / "card.json").exists()
    assert not list((tmp_path / "out").glob("*.parquet"))


@pytest.mark.parametrize(
    ("name", "library"), [("parquet", "pyarrow"), ("minari", "h5py"), ("lerobot", "lerobot")]
)
def test_a_library_that_is_missing_is_named_before_anything_is_read(
    name: FormatName, library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bag: Path
) -> None:
    for module in [module for module in sys.modules if module.partition(".")[0] == library]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"sain_bags.dataset.formats.to_{name}", raising=False)
    with pytest.raises(
        ConfigError, match=rf"--format {name} needs {library}.*pip install 'sain_bags\[{name}\]'"
    ):
        to(name, bag, tmp_path / "out")
    assert not (tmp_path / "out").exists()
