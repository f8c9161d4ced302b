"""Pushes of a real robot as a recording: the report, `to_dataset` and other tools read it."""

import shutil
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rich.console import Console
from rosbags.highlevel import AnyReader

from sain_bags.cli import from_dataset, report
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.recorded import write_recording
from sain_bags.dataset.rows import ConversionConfig
from sain_core.errors import DatasetError, InvalidInputError, OutputError
from sain_core.push import BAR, SPAN_X
from sain_core.shapes import library
from sain_core.storage import read_arrays, write_arrays
from sain_core.transitions import IMPORTED, MOVED, Column, centres, shard_path
from sain_model.cli import real_import
from sain_model.data.dataset import load_dataset
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig
from tests.definitions import find_own
from tests.sain_bags.dataset.formats.exported import drive
from tests.sain_model.importing.recorded import HEADER, PUSHES, simulate, write_csv, write_stated


@pytest.fixture(autouse=True)
def definitions(tmp_path, monkeypatch):
    find_own(tmp_path, monkeypatch)


@pytest.fixture(scope="module")
def imported(tmp_path_factory) -> Path:
    """A data set of pushes with a finger, with two, and with a bar, against two bodies."""
    folder = tmp_path_factory.mktemp("real")
    path = write_csv(folder / "mine.csv", simulate(folder))
    write_stated(folder)
    header, *rows = path.read_text().splitlines()
    more = [(",,,,", ",0.02,0.5,,", ",,,0.03,1.2")[n % 3] for n in range(len(rows))]
    assert len(rows) == 2 * PUSHES and header.split(",") == HEADER.split(",")
    names = f"{header},finger_distance,finger_angle,bar_width,bar_angle"
    path.write_text("\n".join([names, *(a + b for a, b in zip(rows, more, strict=True))]))
    real_import.run(
        real_import.RealImportOptions(paths=(path,), out=folder / "data"), Console(file=StringIO())
    )
    return folder / "data"


def columns(folder: Path) -> dict[str, np.ndarray]:
    found = read_arrays(shard_path(folder, 0))
    order = np.lexsort([found[Column.STEP], found[Column.EPISODE]])
    return {name: column[order] for name, column in found.items()}


def test_a_recording_of_real_pushes_has_the_same_rows_to_the_bit(imported, tmp_path, monkeypatch):
    from_dataset.run(
        from_dataset.FromDatasetOptions(data=imported, out=tmp_path / "bag"),
        Console(file=StringIO()),
    )
    monkeypatch.setattr(library, "_shapes", dict(library._shapes))
    for name in [name for name in library._shapes if "-" in name]:  # as in another process
        del library._shapes[name]
    monkeypatch.setattr(library, "_flat", {})
    convert([tmp_path / "bag"], tmp_path / "back")
    wanted, back = columns(imported), columns(tmp_path / "back")
    assert wanted[Column.ACTION][:, SPAN_X].any() and wanted[Column.ACTION][:, BAR].any()
    for name in IMPORTED:
        np.testing.assert_array_equal(back[name], wanted[name])
        assert back[name].dtype.kind == wanted[name].dtype.kind
    both = [load_dataset(folder) for folder in (imported, tmp_path / "back")]
    for first, second in zip(*(data.parts for data in both), strict=True):
        assert first.bodies == second.bodies


def test_a_data_set_without_strokes_has_the_same_rows(record, tmp_path):
    first = convert([drive(record)], tmp_path / "first", ConversionConfig())
    assert write_recording(tmp_path / "first", tmp_path / "made") == first.transitions
    again = convert([tmp_path / "made"], tmp_path / "again", ConversionConfig())
    assert again.transitions == first.transitions
    one, other = (read_arrays(shard_path(tmp_path / name, 0)) for name in ("first", "again"))
    for name in (Column.STATE, Column.ACTION, Column.NEXT_STATE):
        np.testing.assert_array_equal(one[name], other[name])


@pytest.mark.parametrize(
    ("episode", "any_body"),
    [
        (EpisodeConfig(shapes="t,disk", bodies="2", pushes=2), True),
        (EpisodeConfig(disks=3, pushes=3), False),
    ],
    ids=["all_are_pushed", "one_is_pushed"],
)
def test_a_collection_that_was_recorded_has_the_same_moved_rows(tmp_path, episode, any_body):
    collect(CollectConfig(tmp_path / "made", 2, 3, episode=episode))
    write_recording(tmp_path / "made", tmp_path / "bag")
    convert([tmp_path / "bag"], tmp_path / "back")
    wanted, back = columns(tmp_path / "made"), columns(tmp_path / "back")
    for name in (Column.EPISODE, Column.STEP, Column.NEXT_STATE, Column.MOVED):
        np.testing.assert_array_equal(back[name], wanted[name])
    way = centres(wanted[Column.NEXT_STATE])[:, 1] - centres(wanted[Column.STATE])[:, 1]
    target = np.linalg.norm(way, axis=-1) >= MOVED
    assert wanted[Column.MOVED].any() and (wanted[Column.MOVED] != target).any() == any_body


def test_other_tools_and_the_page_read_it(imported, tmp_path):
    count = write_recording(imported, tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        kinds = [kind.msgtype.rpartition("/")[2] for kind, *_ in reader.messages()]
    assert kinds.count("PushResult") == kinds.count("Stroke") == count
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages()) == len(kinds)
    printed = StringIO()
    options = report.ReportOptions(bag=tmp_path / "bag", out=tmp_path / "page.html")
    report.run(options, Console(file=printed, width=200))
    assert f"{count} pushes" in printed.getvalue()


def _stop(done: int, of: int) -> None:
    if done == 3:
        raise KeyboardInterrupt


def test_what_cannot_be_recorded_is_named(imported, tmp_path, monkeypatch):
    with pytest.raises(DatasetError, match=r"holds no shards \*\.npz; `collect`"):
        write_recording(tmp_path, tmp_path / "bag")
    (tmp_path / "there").mkdir()
    with pytest.raises(OutputError, match="never overwritten"):
        write_recording(imported, tmp_path / "there")
    broken = read_arrays(shard_path(imported, 0))
    del broken[Column.STEP]
    (tmp_path / "lacks").mkdir()
    write_arrays(shard_path(tmp_path / "lacks", 0), broken)
    (tmp_path / "lacks" / "outlines.json").write_bytes((imported / "outlines.json").read_bytes())
    with pytest.raises(DatasetError, match="row 0 lacks an episode or step of 0 or more"):
        write_recording(tmp_path / "lacks", tmp_path / "bag")
    uneven = read_arrays(shard_path(imported, 0))
    uneven[Column.MOVED] = uneven[Column.MOVED][:-1]
    write_arrays(shard_path(tmp_path / "lacks", 0), uneven)
    with pytest.raises(
        DatasetError, match=r"moved has shape .*; it should have \d+ rows, as action"
    ):
        write_recording(tmp_path / "lacks", tmp_path / "bag")
    with pytest.raises(KeyboardInterrupt):
        write_recording(imported, tmp_path / "bag", _stop)
    assert not (tmp_path / "bag").exists()
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(InvalidInputError, match=r"no definition of .* is installed; .*\./env"):
        write_recording(imported, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(
    "name",
    [Column.STATE, Column.ACTION, Column.NEXT_STATE, Column.PHYSICS_NEXT, Column.DURATION],
)
def test_a_number_that_is_none_is_named_and_leaves_no_bag(imported, tmp_path, name, value):
    damaged = Path(shutil.copytree(imported, tmp_path / "damaged"))
    rows = read_arrays(shard_path(damaged, 0))
    rows[name][3] = value
    write_arrays(shard_path(damaged, 0), rows)
    with pytest.raises(DatasetError) as raised:
        write_recording(damaged, tmp_path / "bag")
    assert str(raised.value) == f"{shard_path(damaged, 0)}: row 3 of {name} holds NaN or Inf"
    assert not (tmp_path / "bag").exists()
    if name != Column.DURATION:
        with pytest.raises(DatasetError, match=f"row 3 of {name} holds NaN or Inf"):
            load_dataset(damaged)


def test_recordings_with_and_without_strokes_are_converted_apart(imported, episode_bag, tmp_path):
    write_recording(imported, tmp_path / "strokes")
    with pytest.raises(DatasetError, match=r"strokes states the ways of the tool, .* convert"):
        convert([tmp_path / "strokes", episode_bag], tmp_path / "out")
