"""Recordings become rows: equal to another reader's, and none is lost without a reason."""

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sain_bags.dataset.conversion import Converted, convert
from sain_bags.dataset.rows import ConversionConfig
from sain_core.errors import DatasetError
from sain_core.model import load_dynamics
from sain_core.transitions import RECORDED, Column
from sain_core.workers import WorkerOptions
from sain_model.data.dataset import load_dataset
from tests.sain_bags.driven import BLOCKED, DUPLICATE, Drive, Parts
from tests.sain_bags.independent import compare, independent_rows, shards

Start = Callable[..., Any]


def drive(record: Start, name: str = "bag", parts: Parts = Parts(), seed: int = 0) -> Path:
    """Record two episodes, of four pushes and of two."""
    recording = record(name)
    driver = Drive(recording, parts, seed)
    driver.episode(4, [11, 12, 13, 14])
    driver.episode(5, [15, 16])
    recording.writer.close()
    return Path(recording.writer.folder)


def to_rows(bag: Path, **settings: Any) -> tuple[dict[str, np.ndarray], Converted, dict[str, Any]]:
    """Convert one bag; return its only shard, what was said, and the card."""
    out = bag.parent / f"{bag.name}-rows"
    done = convert([bag], out, ConversionConfig(**settings), overwrite=True)
    with np.load(out / "shard-00000.npz") as shard:
        arrays = dict(shard)
    return arrays, done, json.loads((out / "card.json").read_text())


@pytest.mark.parametrize(
    "parts",
    [
        Parts(),
        Parts(unpredicted=(1,), failed_prediction=(2,)),
        Parts(predictions=False),
        Parts(disks=4),
    ],
)
def test_every_field_is_what_another_reader_reads(parts: Parts, record: Start) -> None:
    bag = drive(record, parts=parts)
    rows, done, _ = to_rows(bag)
    assert done.transitions == 6
    assert compare(rows, bag) >= 6 * 17
    digest = hashlib.sha256((bag / "bag_0.mcap").read_bytes()).hexdigest()
    assert rows["bag_sha256"].tolist() == 6 * [digest]
    (first, *_) = independent_rows(bag)
    known = {*first, "physics_next", "physics_source"}
    assert rows.keys() - known == {"episode", "step", "bag_sha256"}


def test_what_was_not_predicted_is_computed_and_says_so(record: Start) -> None:
    parts = Parts(unpredicted=(1,), failed_prediction=(2,))
    rows, _, card = to_rows(drive(record, parts=parts))
    computed = np.array([False, True, True, False, False, True])
    assert (rows["physics_source"] == "computed:planar").tolist() == computed.tolist()
    expected = load_dynamics("planar").step(
        rows["state"].reshape(-1, 2, 8)[computed], rows["action"][computed]
    )
    np.testing.assert_array_equal(rows["physics_next"].reshape(-1, 2, 8)[computed], expected)
    assert card["physics_from"] == {"bullet_nominal": 3, "computed:planar": 3}


def test_a_push_without_a_result_is_no_row_and_is_named(record: Start) -> None:
    bag = drive(record, parts=Parts(unanswered=(3,)))
    _, done, _ = to_rows(bag)
    assert done == Converted(5, 2, {}, (f"{bag}: 1 pushes have no result, and are no rows",))


def test_refused_and_repeated_pushes_are_counted_apart(record: Start) -> None:
    recording = record()
    driver = Drive(recording)
    driver.episode(1, [1, 2])
    scene = driver.random_scene()
    refused = driver.push_message(3, 1)
    refused.location = float("nan")
    here = driver.scene_message(1, scene)
    driver.result(refused, here, here, BLOCKED)
    again = driver.push_message(2, 1)
    driver.result(again, here, here, DUPLICATE)
    driver.result(again, here, here)  # a second execution under a used id
    driver.push(1, 3, scene, 0)  # the id that was refused is executed at last
    recording.writer.close()
    rows, done, card = to_rows(recording.writer.folder)
    assert rows["push_id"].tolist() == [1, 2, 3]
    assert done.dropped == {"refused": 2, "push id used before": 1}
    examples = card["dropped"]["refused"]["for_example"]
    assert examples[0].endswith("push 3 of episode 1: BLOCKED: a disk is in the way")


def test_unsettled_scenes_are_left_out_unless_kept(record: Start) -> None:
    bag = drive(record, parts=Parts(unsettled=(1,)))
    rows, done, _ = to_rows(bag)
    assert rows["push_id"].tolist() == [11, 13, 14, 15]
    assert rows["step"].tolist() == [0, 2, 3, 0]  # no window spans the gap
    assert done.dropped == {"scene before or after not settled": 2}
    assert to_rows(bag, keep_unsettled=True)[1] == Converted(6, 2, {})


SENSELESS = "makes no sense"


@pytest.mark.parametrize(
    ("path", "value", "reason", "said"),
    [
        ("before.disks.1.x", np.nan, SENSELESS, "x of disk 1 is nan"),
        ("before.disks.1.mass", 0.0, SENSELESS, "mass of disk 1 is 0; allowed: 0.0001 to 100"),
        (
            "before.disks.1.x",
            450.0,
            SENSELESS,
            "x of disk 1 is 450; allowed: -10 to 10; lengths are in m",
        ),
        ("after.disks.1.radius", 80.0, SENSELESS, "radius of disk 1 is 80; allowed: 0.001 to 0.5"),
        (
            "before.disks.0.theta",
            170.0,
            SENSELESS,
            "theta of disk 0 is 170; allowed: -6.28319 to .* rad",
        ),
        ("after.header.frame_id", "map", SENSELESS, "after is in frame 'map'; it must be in 'wor"),
        ("push.length", 5.0, SENSELESS, "length of the push is 5; allowed: 0 to"),
        ("push.angle", 45.0, SENSELESS, "angle of the push is 45; allowed: -"),
        ("push.speed", -1.0, SENSELESS, "speed of the push is -1; allowed: 0.0"),
        ("duration", np.nan, SENSELESS, "is nan; it must be finite"),
        ("after.disks.1.radius", 0.1, "mass or radius", "radius of body 1"),
        ("after.disks.0.mass", 0.5, "mass or radius", "and 0.5 after it"),
        ("after.episode_id", 9, "ids differ", "after.episode_id is 9; ep"),
        ("push.push_id", 7, "ids differ", "push.push_id is 7; push_id is 2"),
    ],
)
def test_a_result_that_cannot_be_is_no_row_and_is_named(
    path: str, value: Any, reason: str, said: str, record: Start
) -> None:
    recording = record()
    driver = Drive(recording)
    driver.episode(1, [1])
    scene = driver.random_scene()
    result = SimpleNamespace(
        push_id=2, episode_id=1, error_code=1, duration=1.0, push=driver.push_message(2, 1),
        before=driver.scene_message(1, scene), after=driver.scene_message(1, scene),
        prediction=recording.messages.make(
            "sain_interfaces/msg/Prediction", **driver.prediction(0, scene)
        ),
    )  # fmt: skip
    *steps, name = path.split(".")
    one: Any = result
    for step in steps:
        one = one[int(step)] if step.isdigit() else getattr(one, step)
    setattr(one, name, value)
    recording.add("/sain/push_result", "PushResult", **vars(result))
    recording.writer.close()
    rows, done, card = to_rows(recording.writer.folder)
    assert rows["push_id"].tolist() == [1]
    assert [(count, reason in found) for found, count in done.dropped.items()] == [(1, True)]
    assert re.search(said, done.left_out[0]) and "push 2 of episode" in done.left_out[0]
    (dropped,) = card["dropped"].values()
    assert re.search(said, dropped["for_example"][0])


def test_a_clock_beyond_the_year_2262_is_refused(record: Start, tmp_path: Path) -> None:
    recording = record()
    recording.now = 2**64 - 2**60
    Drive(recording).episode(1, [1])
    recording.writer.close()
    with pytest.raises(
        DatasetError, match=r"was received at 1\d{19} ns; .* clock was wrong; record"
    ):
        to_rows(recording.writer.folder)


def test_the_card_tells_ranges_and_where_from(record: Start) -> None:
    rows, _, card = to_rows(drive(record))
    travel = np.linalg.norm(rows["next_state"][:, 8:10] - rows["state"][:, 8:10], axis=1)
    spread = card["ranges"]["target_travel"]
    assert spread["maximum"] == travel.max()
    assert spread["mean"] == pytest.approx(travel.mean())
    source = card["sources"][0]
    assert source["sha256"] == rows["bag_sha256"][0]
    assert card["numpy"] == np.__version__
    assert (source["messages"]["Push"], source["transitions"]) == (6, 6)
    assert card["fields"]["state"] == [16]


def test_workers_change_no_byte(record: Start, tmp_path: Path) -> None:
    """Also of pushes that are dropped or predicted, and of two numbers of disks."""
    parts = [Parts(predictions=False), Parts(disks=3), Parts(unsettled=(1,)), Parts(still=(0,))]
    bags = [drive(record, f"bag{index}", part, index) for index, part in enumerate(parts)]
    config = ConversionConfig(moved_only=True)
    alone = convert(bags, tmp_path / "alone", config)
    two = WorkerOptions(workers=2)
    assert convert(bags, tmp_path / "workers", config, workers=two) == alone
    assert alone.dropped
    files = [sorted((tmp_path / name).iterdir()) for name in ("alone", "workers")]
    assert len(files[0]) > 2 and len(files[0]) == len(files[1])
    for one, other in zip(*files, strict=True):
        assert one.name == other.name and one.read_bytes() == other.read_bytes(), one


def test_a_damaged_recording_of_several_is_named(record: Start, tmp_path: Path) -> None:
    bags = [drive(record), drive(record, "broken")]
    file = bags[1] / "broken_0.mcap"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    for workers in (1, 2):
        with pytest.raises(DatasetError, match="broken"):
            convert(bags, tmp_path / str(workers), workers=WorkerOptions(workers=workers))


def test_rows_have_the_friction_of_their_episode(record: Start, tmp_path: Path) -> None:
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
    np.testing.assert_array_equal(shards(tmp_path / "out")["rim_friction"], 2 * np.array(expected))
    np.testing.assert_array_equal(shards(tmp_path / "out")["tool_friction"], 3 * np.array(expected))


def test_numbers_of_disks_go_to_shards_of_their_own(record: Start, tmp_path: Path) -> None:
    bags = [drive(record), drive(record, "three", Parts(disks=3))]
    convert(bags, tmp_path / "out")
    with pytest.raises(DatasetError, match="scenes with the same bodies are needed"):
        _ = load_dataset(tmp_path / "out").alike
    mixed = load_dataset(tmp_path / "out")
    assert [(part.disks, len(part)) for part in mixed.parts] == [(2, 6), (3, 6)]
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert card["disks"] == {"2": 6, "3": 6}


@pytest.mark.parametrize("disks", [2, 3])
def test_every_column_is_as_the_schema_has_it(disks: int, record: Start) -> None:
    rows, done, card = to_rows(drive(record, parts=Parts(disks=disks)))
    assert list(rows)[: len(RECORDED)] == list(RECORDED)
    for name, values in rows.items():
        column = Column(name)
        assert values.shape == (done.transitions, *column.row_shape(disks)), name
        assert values.dtype.kind == np.dtype(column.dtype).kind, name
        assert column.dtype == "str" or values.dtype == column.dtype, name
    assert card["fields"] == {name: list(values.shape[1:]) for name, values in rows.items()}
