"""A damaged bag is saved up to its damage, nothing damaged passes for data, losses are named."""

import errno
import os
import tracemalloc
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from sain_bags import commands
from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.mcap import integrity
from sain_bags.reading.reader import Bag
from sain_bags.recovery import recover
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import DatasetError, OutputError
from sain_core.randomness import generator

COMPRESSIONS = ("none", "lz4", "zstd")
TEXT = "string data\n"
SPOILT = 8  # of each compression
Saved = tuple[str, int, int, int, bytes]


@dataclass(frozen=True)
class Original:
    """A whole bag, and what a recovery can take from parts of it."""

    folder: Path
    content: bytes
    messages: list[Saved]
    ends: list[tuple[int, int]]  # of each chunk: where it ends, messages until then
    data_end: int  # where the record ends that ends the data


def saved(path: Path) -> list[Saved]:
    """Read a file's messages in its order, without our own reader."""
    with path.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [(c.topic, m.log_time, m.publish_time, m.sequence, m.data) for _, c, m in found]


def original(folder: Path, compression: str, custom_data: dict[str, str] | None = None) -> Original:
    """Record a bag of many chunks; a topic comes late, another never has a message."""
    random = generator(5)
    config = BagConfig(compression=compression, chunk_size=1024)
    with BagWriter(folder, config, custom_data) as writer:
        for name in ("/chat", "/silent"):
            qos = (TopicQos(durability="transient_local"),)
            writer.add_topic(Topic(name, "std_msgs/msg/String", TEXT, "RIHS01_ab", qos))
        for number in range(60):
            if number == 30:
                writer.add_topic(Topic("/late", "test/msg/Late", "uint8[] data\n"))
            topic = "/late" if number >= 30 and number % 3 == 0 else "/chat"
            data = bytes(4) + random.bytes(int(random.integers(400))) * 2
            writer.write(topic, data, 1000 + 10 * number, 999 + 10 * number, number)
    file = folder / f"{folder.name}_0.mcap"
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    ends, count = [], 0
    for index in summary.chunk_indexes:
        with file.open("rb") as stream:
            count += sum(
                index.message_start_time <= message.log_time <= index.message_end_time
                for _, _, message in make_reader(stream).iter_messages()
            )
        ends.append((index.chunk_start_offset + index.chunk_length, count))
    with file.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=True).records
        next(record for record in records if isinstance(record, DataEnd))
        data_end = stream.tell()
    return Original(folder, file.read_bytes(), saved(file), ends, data_end)


@pytest.fixture(scope="module", params=COMPRESSIONS)
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Original:
    return original(tmp_path_factory.mktemp("whole") / "bag", request.param)


@pytest.fixture
def zstd_bag(tmp_path: Path) -> Original:
    return original(tmp_path / "bag", "zstd", {"seed": "7"})


def recovered(content: bytes, folder: Path, name: str = "out") -> tuple[list[str], list[Saved]]:
    """Recover a file of this content; return what was lost, and the messages that were saved."""
    file = folder / f"{name}.mcap"
    file.write_bytes(content)
    found = recover(file, folder / name)
    assert file.read_bytes() == content
    if not found.span.messages:
        assert not (folder / name).exists()
        return found.losses, []
    messages = saved(folder / name / f"{name}_0.mcap")
    whole = Bag(folder / name)
    whole.check()
    assert whole.message_count == found.span.messages == len(messages)
    return found.losses, messages


def is_subsequence(part: list[Saved], whole: list[Saved]) -> bool:
    rest = iter(whole)
    return all(message in rest for message in part)


def test_a_file_is_saved_up_to_where_it_was_cut(bag: Original, tmp_path: Path) -> None:
    for number, cut in enumerate(generator(1).integers(len(bag.content), size=SPOILT)):
        lost, messages = recovered(bag.content[:cut], tmp_path, f"cut_{number}")
        whole = max((count for end, count in bag.ends if end <= cut), default=0)
        assert messages == bag.messages[:whole], cut
        assert bool(lost) == (cut < bag.data_end), cut


def test_flipped_bits_never_make_a_message(bag: Original, tmp_path: Path) -> None:
    random = generator(2)
    for number in range(SPOILT):
        place, bit = int(random.integers(len(bag.content))), int(random.integers(8))
        damaged = bytearray(bag.content)
        damaged[place] ^= 1 << bit
        lost, messages = recovered(bytes(damaged), tmp_path, f"flip_{number}")
        assert is_subsequence(messages, bag.messages), (place, bit)
        assert lost or messages == bag.messages, (place, bit)


def test_the_loss_is_named_with_its_place_and_time(
    zstd_bag: Original, tmp_path: Path, capsys: Any
) -> None:
    content = bytearray(zstd_bag.content)
    content[zstd_bag.ends[4][0] - 20] ^= 1
    saves = [str(zstd_bag.folder), "--out"]
    assert commands.recover([*saves, str(tmp_path / "whole")]) == 0
    (zstd_bag.folder / "bag_0.mcap").write_bytes(content)
    capsys.readouterr()
    assert commands.recover([*saves, str(tmp_path / "out")]) == 3
    said = " ".join("".join(capsys.readouterr()).split())
    count = zstd_bag.ends[3][1]
    assert f"Saved {count} messages" in said
    assert "bag_0.mcap: not read from byte " in said and "after the message of 0.000 s: " in said
    place = int(said.partition("from byte ")[2].partition(" on")[0].replace(",", ""))
    assert zstd_bag.ends[3][0] <= place < zstd_bag.ends[4][0]
    custom_data = Bag(tmp_path / "out").custom_data
    assert custom_data == {"seed": "7", "recovered": "with losses, from bag"}
    assert commands.recover([*saves, str(tmp_path / "out")]) == 1
    assert "exists" in capsys.readouterr().err
    (zstd_bag.folder / "bag_0.mcap").write_bytes(b"")
    assert commands.recover([*saves, str(tmp_path / "nothing")]) == 1


def test_bytes_behind_the_end_are_named(zstd_bag: Original, tmp_path: Path) -> None:
    lost, messages = recovered(2 * zstd_bag.content, tmp_path)
    size = f"{len(zstd_bag.content):,}"
    assert lost == [f"out.mcap: not read from byte {size} on: bytes follow its end"]
    assert messages == zstd_bag.messages


def test_nothing_is_overwritten_and_nothing_half_is_left(
    zstd_bag: Original, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(OutputError, match="exists; a bag is never overwritten"):
        recover(zstd_bag.folder, zstd_bag.folder)
    with pytest.raises(DatasetError, match="there is no MCAP file at"):
        recover(tmp_path / "nowhere", tmp_path / "out")

    def no_space(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(OutputError, match="No space left on device"):
        recover(zstd_bag.folder, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_a_chunk_that_contradicts_the_file_ends_it(zstd_bag: Original, tmp_path: Path) -> None:
    """As where the rest of an older file stands in sectors that were never written."""
    with BagWriter(tmp_path / "older") as writer:
        writer.add_topic(Topic("/other", "std_msgs/msg/String", TEXT))
        writer.write("/other", b"\x00\x01\x00\x00old", 5)
    with (tmp_path / "older" / "older_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    (index,) = summary.chunk_indexes
    older = (tmp_path / "older" / "older_0.mcap").read_bytes()
    stale = older[index.chunk_start_offset : index.chunk_start_offset + index.chunk_length]
    place = zstd_bag.ends[2][0]
    mixed = zstd_bag.content[:place] + stale + zstd_bag.content[place:]
    lost, messages = recovered(mixed, tmp_path)
    assert "it describes a channel otherwise than the file does before" in lost[0]
    assert messages == zstd_bag.messages[: zstd_bag.ends[2][1]]


def test_a_folder_of_sqlite3_is_named_with_what_saves_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3).open()
    assert commands.recover([str(tmp_path / "bag"), "--out", str(tmp_path / "out")]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "bag.db3 is a sqlite3 file; `sqlite3 FILE .recover` saves those" in said


def unchunked(path: Path) -> list[int]:
    """Write messages outside of chunks; return where each ends."""
    ends = []
    with path.open("wb") as stream:
        writer = McapWriter(stream, use_chunking=False, enable_data_crcs=True)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", TEXT.encode())
        channel = writer.register_channel("/chat", "cdr", schema)
        for number in range(20):
            writer.add_message(channel, number, bytes([number]) * 40, number, number)
            ends.append(stream.tell())
        writer.finish()
    return ends


def test_messages_outside_of_chunks_are_saved_up_to_a_cut(tmp_path: Path) -> None:
    ends = unchunked(tmp_path / "whole.mcap")
    whole = saved(tmp_path / "whole.mcap")
    content = (tmp_path / "whole.mcap").read_bytes()
    assert recovered(content, tmp_path, "all") == ([], whole)
    for cut in (ends[0] - 1, ends[0], ends[7] + 5, ends[-1]):
        lost, messages = recovered(content[:cut], tmp_path, f"cut_{cut}")
        assert messages == whole[: sum(end <= cut for end in ends)]
        assert "the file has no end" in lost[0]


def test_more_topics_than_are_read_are_named_with_the_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(integrity, "TOPICS", 100)
    with (tmp_path / "many.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", TEXT.encode())
        for number in range(101):
            channel = writer.register_channel(f"/chat_{number}", "cdr", schema)
            writer.add_message(channel, number, bytes(8), number)
        writer.finish()
    text = f"{tmp_path}/many.mcap is not recovered: it has more than 100 topics"
    with pytest.raises(DatasetError, match=f"^{text}$"):
        recover(tmp_path / "many.mcap", tmp_path / "saved")
    assert [path.name for path in tmp_path.iterdir()] == ["many.mcap"]


def test_a_compression_that_is_none_of_mcap_is_named(zstd_bag: Original, tmp_path: Path) -> None:
    content = zstd_bag.content.replace(b"zstd", b"brot", 1)
    (zstd_bag.folder / "bag_0.mcap").write_bytes(content)
    said = "it is compressed with 'brot'; allowed: zstd, lz4 or nothing"
    assert said in recovered(content, tmp_path)[0][0]
    with pytest.raises(DatasetError, match=said):
        Bag(tmp_path / "out.mcap").check()


def test_the_files_of_a_split_bag_stay_in_their_order(tmp_path: Path) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    for number in (0, 1, 10):
        part = original(tmp_path / f"part_{number}", "zstd")
        (folder / f"split_{number}.mcap").write_bytes(part.content)
    assert not recover(folder, tmp_path / "out").losses
    assert [path.name for path in Bag(tmp_path / "out").files] == [
        f"out_{number}.mcap" for number in range(3)
    ]
    found = {topic.name: topic.messages for topic in Bag(tmp_path / "out").topics}
    assert found == {"/chat": 150, "/silent": 0, "/late": 30}


def test_memory_does_not_grow_with_the_bag(tmp_path: Path) -> None:
    peaks = []
    for messages in (100, 1000):
        folder = tmp_path / str(messages)
        with BagWriter(folder, BagConfig(compression="none")) as writer:
            writer.add_topic(Topic("/chat", "std_msgs/msg/String", TEXT))
            for number in range(messages):
                writer.write("/chat", bytes([number % 256]) * 20_000, 1 + number)
        tracemalloc.start()
        recover(folder, tmp_path / f"out_{messages}")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 1e6  # the larger bag has 18 MB more


def test_two_types_on_a_topic_are_counted_apart(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for number, kind in enumerate(("std_msgs/msg/String", "std_msgs/msg/Bool")):
            connection = writer.add_connection("/chat", kind, typestore=store)
            for time in range(3 - number):
                writer.write(connection, 1000 + time, bytes([0, 1, 0, 0, 0]))
    assert not recover(tmp_path / "bag", tmp_path / "out").losses
    counts = {one.type: one.messages for one in Bag(tmp_path / "out").topics}
    assert counts == {"std_msgs/msg/String": 3, "std_msgs/msg/Bool": 2}
