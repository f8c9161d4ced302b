"""Bags that were made elsewhere convert to the same rows, or it is said what is wrong with them."""

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rich.console import Console
from rosbags.rosbag2 import StoragePlugin, Writer

from sain_bags.cli.info import show
from sain_bags.dataset.conversion import convert
from sain_bags.reading.reader import Bag, Raw
from sain_bags.report.content import read_content
from sain_core.errors import DatasetError
from sain_core.randomness import generator
from tests.sain_bags.driven import Drive, Parts
from tests.sain_bags.independent import compare, shards

Start = Callable[..., Any]
NOT_COMPARED = {"bag_sha256"}


@pytest.fixture
def bag(record: Start) -> Path:
    """A bag of ours, of three pushes."""
    recording = record()
    driver = Drive(recording)
    driver.episode(1, [1, 2])
    driver.episode(2, [3])
    recording.writer.close()
    return Path(recording.writer.folder)


def rows(bag: Path) -> dict[str, np.ndarray]:
    out = bag.parent / f"{bag.name}-rows"
    convert([bag], out, overwrite=True)
    return shards(out)


def same(bag: Path, other: Path) -> bool:
    """Tell whether two bags make the same rows."""
    wanted, found = rows(bag), rows(other)
    for key in wanted.keys() - NOT_COMPARED:
        np.testing.assert_array_equal(found[key], wanted[key], key)
    return True


def write_mcap(path: Path, messages: list[Raw], bag: Bag, **options: Any) -> None:
    """Write messages of a bag with `mcap` itself, whatever its options are."""
    with path.open("wb") as stream:
        writer = McapWriter(stream, **options)
        writer.start(profile="ros2")
        channels = {}
        for found in bag.channels:
            assert found.schema is not None
            schema = writer.register_schema(found.type, "ros2msg", found.schema.data)
            channels[found.topic] = writer.register_channel(found.topic, "cdr", schema)
        for raw in messages:
            writer.add_message(
                channels[raw.topic], raw.log_time, raw.data, raw.publish_time, raw.sequence
            )
        writer.finish()


def write_metadata(folder: Path, version: int, files: list[str]) -> None:
    """Write what rosbag2 does beside its files, as little as it takes."""
    (folder / "metadata.yaml").write_text(
        yaml.safe_dump(
            {
                "rosbag2_bagfile_information": {
                    "version": version,
                    "storage_identifier": "mcap",
                    "relative_file_paths": files,
                    "compression_format": "",
                    "compression_mode": "",
                }
            }
        )
    )


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4, "chunk_size": 1024},
        {"compression": CompressionType.ZSTD, "chunk_size": 1024, "enable_data_crcs": False},
        {"use_chunking": False},
        {"use_chunking": False, "enable_data_crcs": True},
        {"enable_crcs": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK, "chunk_size": 1024},
        {"index_types": IndexType.MESSAGE, "chunk_size": 1024},
    ],
)
def test_however_mcap_lays_a_file_out(options: dict[str, Any], bag: Path, tmp_path: Path) -> None:
    messages = list(Bag(bag).raw_messages())
    write_mcap(tmp_path / "other.mcap", messages, Bag(bag), **options)
    assert list(Bag(tmp_path / "other.mcap").raw_messages()) == messages
    assert same(bag, tmp_path / "other.mcap")


@pytest.mark.parametrize(
    ("options", "state"),
    [
        ({}, "every CRC is right"),
        ({"use_chunking": False, "enable_data_crcs": True}, "every CRC is right"),
        ({"use_chunking": False}, "it has no CRCs: damage inside messages is not detected"),
        ({"enable_crcs": False}, "it has no CRCs: damage inside messages is not detected"),
    ],
)
def test_info_states_whether_there_are_crcs(
    options: dict[str, Any], state: str, bag: Path, tmp_path: Path
) -> None:
    write_mcap(tmp_path / "other.mcap", list(Bag(bag).raw_messages()), Bag(bag), **options)
    console = Console(width=200, file=StringIO())
    show(tmp_path / "other.mcap", console)
    assert console.file.getvalue().splitlines()[0].endswith(state)  # type: ignore[attr-defined]


@pytest.mark.parametrize("version", range(1, 10))
def test_the_folders_of_all_versions_of_rosbag2(version: int, bag: Path, tmp_path: Path) -> None:
    folder = tmp_path / "other"
    folder.mkdir()
    write_mcap(folder / "other_0.mcap", list(Bag(bag).raw_messages()), Bag(bag))
    write_metadata(folder, version, ["other/other_0.mcap" if version < 4 else "other_0.mcap"])
    assert same(bag, folder)


@pytest.mark.parametrize("storage", StoragePlugin)
@pytest.mark.parametrize("version", [8, 9])
def test_bags_that_rosbags_wrote(
    storage: StoragePlugin, version: Any, bag: Path, tmp_path: Path
) -> None:
    hashes = {topic.name: topic.type_hash for topic in Bag(bag).topics}
    sqlite_bag(bag, tmp_path / "other", storage=storage, version=version)
    assert same(bag, tmp_path / "other")
    found = Bag(tmp_path / "other")
    assert {topic.name: topic.type_hash for topic in found.topics} == hashes
    assert found.file.suffix == (".db3" if storage is StoragePlugin.SQLITE3 else ".mcap")
    assert compare(rows(tmp_path / "other"), tmp_path / "other") > 0


def text_of(channel: Any) -> str:
    return str(channel.schema.data.decode())


def sqlite_bag(
    bag: Path,
    folder: Path,
    other_type: str = "",
    storage: StoragePlugin = StoragePlugin.SQLITE3,
    version: Any = 9,
) -> Path:
    """Copy a bag as rosbag2 has it, with another type on the topic of results if one is named."""
    ours = Bag(bag)
    about: dict[str, Any] = {"rihs01": "RIHS01_" + 64 * "0"}
    hashes = {topic.name: topic.type_hash for topic in ours.topics}
    with Writer(folder, version=version, storage_plugin=storage) as writer:
        connections = {
            one.topic: writer.add_connection(
                one.topic, one.type, msgdef=text_of(one), rihs01=hashes[one.topic]
            )
            for one in ours.channels
        }
        for raw in ours.raw_messages():
            writer.write(connections[raw.topic], raw.log_time, raw.data)
        if other_type:
            topic, text = "/sain/push_result", "string data\n"
            strange = writer.add_connection(topic, other_type, msgdef=text, **about)
            for time in (ours.start, ours.start + 10**9):
                writer.write(strange, time, b"\0\1\0\0\6\0\0\0hello\0")
    return folder


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
def test_messages_in_a_journal_are_read(mode: str, bag: Path, tmp_path: Path) -> None:
    """After a power cut the file is as it was, and a journal beside it has the rest."""
    folder = sqlite_bag(bag, tmp_path / "sqlite")
    (file,) = folder.glob("*.db3")
    work = tmp_path / "work.db3"
    shutil.copy(file, work)
    base = sqlite3.connect(work, isolation_level=None)
    rows = base.execute("SELECT * FROM messages ORDER BY timestamp").fetchall()
    if mode == "WAL":
        base.execute("DELETE FROM messages WHERE timestamp > ?", (rows[4][2],))
    base.execute(f"PRAGMA journal_mode = {mode}")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    base.execute("PRAGMA cache_size = 1")  # writes into the file before the end
    base.execute("BEGIN")
    if mode == "WAL":
        base.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows[5:])
        base.execute("COMMIT")
    else:
        base.execute("UPDATE messages SET data = zeroblob(length(data))")
    for ending in ("", "-wal", "-journal"):
        if (left := Path(f"{work}{ending}")).exists():
            shutil.copy(left, f"{file}{ending}")
    base.close()
    assert Path(f"{file}-{'wal' if mode == 'WAL' else 'journal'}").stat().st_size
    before = sorted((one.name, one.read_bytes()) for one in folder.iterdir())
    folder.chmod(0o555)
    assert same(bag, folder)
    assert sorted((one.name, one.read_bytes()) for one in folder.iterdir()) == before


def test_files_that_are_not_as_the_metadata_says(bag: Path, tmp_path: Path) -> None:
    folder = sqlite_bag(bag, tmp_path / "sqlite")
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as base, base:
        base.execute("DELETE FROM messages WHERE id = (SELECT max(id) FROM messages)")
    advice = f"`ros2 bag reindex -s sqlite3 {folder}` makes"
    with pytest.raises(DatasetError, match=rf"has 10 messages of /sain/scene, not 11 .*{advice}"):
        convert([folder], tmp_path / "out")
    shutil.copy(file, folder / "sqlite_1.db3")
    with pytest.raises(
        DatasetError, match=rf"holds sqlite_1.db3, which .* does not name.*{advice}"
    ):
        convert([folder], tmp_path / "out")
    (folder / "metadata.yaml").unlink()
    with pytest.raises(DatasetError, match=rf"not closed.*no metadata.yaml; {advice}"):
        convert([tmp_path], tmp_path / "out")  # one below a folder is not passed over
    assert Bag(file).message_count == Bag(bag).message_count - 1  # alone, as it is


def test_of_two_types_on_a_topic_the_graphs_is_read(bag: Path, tmp_path: Path) -> None:
    kind = "std_msgs/msg/String"
    folder = sqlite_bag(bag, tmp_path / "sqlite", kind)
    ours = Bag(bag)
    with (tmp_path / "two.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2")
        for found in (*ours.channels, None):
            name, text = (found.type, text_of(found)) if found else (kind, "string data")
            schema = writer.register_schema(name, "ros2msg", text.encode())
            topic = found.topic if found else "/sain/push_result"
            channel = writer.register_channel(topic, "cdr", schema)
            for raw in ours.raw_messages([topic]) if found else ():
                writer.add_message(channel, raw.log_time, raw.data, raw.log_time)
        for time in (ours.start, ours.start + 10**9):
            writer.add_message(channel, time, b"\0\1\0\0\6\0\0\0hello\0", time)
        writer.finish()
    for other in (folder, tmp_path / "two.mcap"):
        notes = convert([other], tmp_path / "out", overwrite=True).notes
        said = f"/sain/push_result has 2 messages of another type, {kind}; they are left out"
        assert sum(said in note for note in notes) == 1
        assert same(bag, other)
        assert read_content(Bag(other)).pushes == 3
        assert {one.type: one.messages for one in Bag(other).topics if "result" in one.name} == {
            kind: 2, "sain_interfaces/msg/PushResult": 3
        }  # fmt: skip


def test_a_split_bag_is_read_as_one(bag: Path, tmp_path: Path) -> None:
    messages = list(Bag(bag).raw_messages())
    folder = tmp_path / "split"
    folder.mkdir()
    # The second file begins before the first ends, as with several writing threads.
    parts = (messages[:12], messages[13:20], [messages[12], *messages[20:]])
    names = [f"split_{number}.mcap" for number in range(len(parts))]
    for name, part in zip(names, parts, strict=True):
        write_mcap(folder / name, part, Bag(bag), chunk_size=1024)
    write_metadata(folder, 9, names)
    split = Bag(folder)
    assert [raw.log_time for raw in split.raw_messages()] == [raw.log_time for raw in messages]
    assert {t.name: t.messages for t in split.topics} == {
        t.name: t.messages for t in Bag(bag).topics
    }
    assert (split.message_count, split.duration) == (len(messages), Bag(bag).duration)
    assert same(bag, folder)
    after = [raw for raw in messages if raw.log_time >= messages[15].log_time]
    assert list(split.raw_messages(start=messages[15].log_time)) == after
    (folder / names[1]).unlink()
    with pytest.raises(DatasetError, match=r"metadata.yaml names .*; split_1.mcap is not there"):
        Bag(folder)


def test_time_that_goes_backwards(bag: Path, tmp_path: Path) -> None:
    messages = list(Bag(bag).raw_messages())
    shuffled = [messages[i] for i in generator(3, 0).permutation(len(messages))]
    write_mcap(tmp_path / "other.mcap", shuffled, Bag(bag), chunk_size=1024)
    assert list(Bag(tmp_path / "other.mcap").raw_messages()) == messages
    assert same(bag, tmp_path / "other.mcap")
    back = [raw._replace(log_time=2 * messages[0].log_time - raw.log_time) for raw in messages]
    write_mcap(tmp_path / "back.mcap", back, Bag(bag), chunk_size=1024)
    assert sorted(rows(tmp_path / "back.mcap")["push_id"].tolist()) == [
        1,
        2,
        3,
    ]  # ids pair, no time


def redefined(bag: Path, out: Path, change: Callable[[str], str], kind: str) -> Path:
    """Copy a bag with another definition of a type, under the same name."""
    ours = Bag(bag)
    for found in ours.channels:
        assert found.schema is not None
        if found.type.endswith(kind):
            found.schema.data = change(found.schema.data.decode()).encode()
    write_mcap(out, list(ours.raw_messages()), ours)
    return out


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("uint64 push_id\n", "uint64 number\n", "sain_interfaces/msg/PushResult has no push_id"),
        (
            "uint64 push_id\n",
            "uint64 push_id\nfloat64 x\n",
            "PushResult has x: it is of another ver",
        ),
        ("uint64 push_id\n", "string push_id\n", "push_id of .*PushResult is a string"),
        ("float64 radius ", "uint8 radius ", r"elements cannot be in"),
        ("float64 radius ", "float64[9] radius ", "before.disks.radius of .* is an array"),
        ("DiskState[] disks", "Disks[] disks", "Disks, of disks .* described"),
    ],
)
def test_definitions_that_are_not_this_graphs_are_named(
    old: str, new: str, said: str, bag: Path, tmp_path: Path
) -> None:
    other = redefined(bag, tmp_path / "o.mcap", lambda text: text.replace(old, new), "/PushResult")
    with pytest.raises(DatasetError, match=f"o.mcap holds messages of another definition.*{said}"):
        convert([other], tmp_path / "out")


def test_a_sqlite3_bag_that_is_none(bag: Path) -> None:
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("identifier: mcap", "identifier: sqlite3"))
    with pytest.raises(DatasetError, match=r"bag_0.mcap cannot be read: file is not a database"):
        Bag(bag)


def test_a_file_of_another_recording(bag: Path, record: Start) -> None:
    recording = record("other")
    recording.now += 3_600_000_000_000
    driver = Drive(recording)
    driver.episode(1, [1, 2])
    driver.episode(2, [3])
    recording.writer.close()
    shutil.copy(recording.writer.folder / "other_0.mcap", bag / "bag_0.mcap")
    with pytest.raises(
        DatasetError, match=r"bag_0.mcap is of another recording than metadata.yaml"
    ):
        Bag(bag)


def test_a_definition_with_its_fields_in_another_order(record: Start, tmp_path: Path) -> None:
    """Foreign definitions are followed: here the message is written by hand in another order."""
    recording = record()
    driver = Drive(recording, Parts(scenes=False))
    driver.episode(1, [1])
    recording.writer.close()
    ours = Bag(recording.writer.folder)
    messages = [
        raw._replace(data=raw.data[:52] + raw.data[60:68] + raw.data[52:60] + raw.data[68:])
        if raw.type.endswith("/Goal")  # x of its pose is at 52, and y at 60
        else raw
        for raw in ours.raw_messages()
    ]
    for found in ours.channels:
        assert found.schema is not None
        if found.type.endswith("/Goal"):
            text = found.schema.data.decode()
            swapped = text.replace("float64 x ", "float64 q ").replace("float64 y ", "float64 x ")
            found.schema.data = swapped.replace("float64 q ", "float64 y ").encode()
    write_mcap(tmp_path / "other.mcap", messages, ours)
    found_rows, wanted = rows(tmp_path / "other.mcap"), rows(recording.writer.folder)
    np.testing.assert_array_equal(found_rows["goal_poses"], wanted["goal_poses"])
