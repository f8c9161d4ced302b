"""Every format, read back by its own library, holds what the npz shards of the same bag hold."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

os.environ["HF_HUB_OFFLINE"] = "1"  # before the libraries are imported: nothing here asks a hub

import pandas
import polars
import pyarrow
import pytest
from pyarrow import parquet

from sain_core.policy import GOAL, HIT, STATE
from sain_core.transitions import PARTS
from tests.sain_bags.dataset.formats.exported import EPISODES, Rows, card_of, to
from tests.sain_bags.driven import Drive


def in_order(rows: Rows, card: dict[str, Any]) -> Rows:
    """Return rows with the parts of the split one after another, as a card says what they are."""
    named = card["split"]["episodes"]
    held = {part: np.isin(rows["episode"], named.get(part, [])) for part in PARTS}
    held["train"] = ~(held["validation"] | held["test"])
    order = np.concatenate([np.flatnonzero(held[part]) for part in PARTS])
    return {key: values[order] for key, values in rows.items()} | {
        "split": np.repeat(PARTS, [int(held[part].sum()) for part in PARTS])
    }


def assert_same(found: Any, wanted: ndarray, key: str) -> None:
    """Compare values to the bit."""
    np.testing.assert_array_equal(np.array(list(found), dtype=wanted.dtype), wanted, key)


def test_parquet_is_read_back_by_pandas_polars_and_datasets(
    bag: Path, rows: Rows, tmp_path: Path
) -> None:
    import datasets

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


def test_parquet_has_the_types_and_the_card_in_its_schema(bag: Path, tmp_path: Path) -> None:
    out = to("parquet", bag, tmp_path / "out")
    schema = parquet.read_schema(out / "train-00000.parquet")
    assert schema.field("state").type == pyarrow.list_(pyarrow.float64(), 16)
    assert schema.field("action").type == pyarrow.list_(pyarrow.float64(), 5)
    assert schema.field("stamp").type == pyarrow.int64()
    assert schema.field("push_id").type == pyarrow.uint64()
    assert schema.field("moved").type == pyarrow.bool_()
    assert json.loads(schema.metadata[b"sain"]) == card_of(out)


def test_lerobot_is_read_back_by_lerobot(bag: Path, rows: Rows, tmp_path: Path) -> None:
    # Here and not above: seconds, which every worker would spend when it collects.
    from sain_bags.dataset.formats.to_lerobot import LeRobotDataset

    out = to("lerobot", bag, tmp_path / "out")
    wanted = in_order(rows, card_of(out))
    data = LeRobotDataset("pushes", root=out)
    assert (data.num_frames, data.num_episodes, data.fps) == (len(rows["episode"]), 2 * EPISODES, 1)
    exact = data.hf_dataset.with_format(None)
    renamed = {"state": STATE, "next_state": "next.state"}
    unstated = {"friction", "rim_friction", "tool_friction"}
    assert not unstated & exact.features.keys()
    goal = [key for key in wanted if key.startswith("goal_")]
    places = wanted["goal_poses"][:, 3:5]  # of the target alone, with any heading
    wanted |= {key: np.nan_to_num(wanted[key]) for key in goal}
    for key in rows.keys() - unstated:
        values = exact[renamed.get(key, key)]
        if wanted[key].dtype == np.uint64:  # of which LeRobot has none
            values = np.array(list(values)).view(np.uint64)
        assert_same(values, wanted[key], key)
    asked = [np.insert(np.pad(place, (0, 2)), 0, 1.0) for place in places]
    assert_same(exact[GOAL], np.column_stack([np.zeros((len(asked), 5)), asked]), GOAL)
    distance = np.linalg.norm(wanted["next_state"][:, 8:10] - places, axis=1)
    np.testing.assert_allclose(exact["next.reward"], -distance, rtol=1e-14)
    assert exact["next.done"][:] == [False, True] * (2 * EPISODES)  # two pushes, the gap, two more
    assert not any(exact["next.success"])
    frame = data[3]
    assert frame["task"] == HIT
    np.testing.assert_array_equal(frame["action"], wanted["action"][3].astype(np.float32))
    assert (frame["timestamp"], frame["frame_index"], frame["episode_index"]) == (1.0, 1, 1)
    names = data.features[STATE]["names"]
    assert (names[0], names[8], len(names)) == ("mid_x", "target_x", 16)
    np.testing.assert_allclose(data.meta.stats["action"]["mean"], wanted["action"].mean(axis=0))
    for part, span in data.meta.info["splits"].items():
        held = LeRobotDataset("pushes", root=out, episodes=list(range(*map(int, span.split(":")))))
        ids = np.array([int(number) for number in held.hf_dataset["push_id"]]).view(np.uint64)
        assert ids.tolist() == wanted["push_id"][wanted["split"] == part].tolist()


def no_constant(name: str) -> None:
    raise AssertionError(f"{name} is no JSON by RFC 8259")


@pytest.mark.parametrize("with_goal", [True, False])
def test_statistics_of_lerobot_are_of_what_is_there(
    with_goal: bool, record: Any, tmp_path: Path
) -> None:
    """Here episodes have one push each, and all but the first have no goal."""
    from sain_bags.dataset.formats.to_lerobot import GOAL, REWARD, LeRobotDataset

    recording = record("bäg")
    driver = Drive(recording)
    if with_goal:
        driver.episode(1, [1])
    for number in (2, 3):
        driver.scene_id += 1
        driver.push(number, number, driver.random_scene(), 0)
    recording.writer.close()
    out = to("lerobot", Path(recording.writer.folder), tmp_path / "öut")
    for file in out.rglob("*.json"):
        json.loads(file.read_text(), parse_constant=no_constant)
    (episodes,) = (out / "meta" / "episodes").rglob("*.parquet")
    table = parquet.read_table(episodes).to_pydict()
    of_episodes = {key: np.array(table[key], float) for key in table if key.startswith("stats/")}
    assert len(of_episodes) > 100
    assert [key for key, found in of_episodes.items() if not np.isfinite(found).all()] == []
    stats = json.loads((out / "meta/stats.json").read_text())
    data = LeRobotDataset("pushes", root=out)
    if not with_goal:
        assert REWARD not in stats and REWARD not in data.features
        assert not np.any(stats[GOAL]["max"])
        return
    rewards = np.array(data.hf_dataset.with_format(None)[REWARD])
    there = rewards[np.isfinite(rewards)]
    assert len(there) == 1
    names = data.features[GOAL]["names"]
    assert names[5:] == [
        f"target_goal_{one}" for one in ("wanted", "x", "y", "theta_wanted", "theta")
    ]
    np.testing.assert_allclose(stats[GOAL]["max"][5:], [1.0, 0.1, 0.2, 0.0, 0.0])
    assert stats[REWARD]["count"] == [1] and stats["action"]["count"] == [3]
    for name in ("min", "mean", "max", "q01", "q50", "q99"):
        np.testing.assert_allclose(stats[REWARD][name], there)
    texts = {key for key, feature in data.features.items() if feature["dtype"] == "string"}
    assert stats.keys() >= data.features.keys() - texts
