"""A split bag is one bag: nothing is lost between its files, and what is latched is in each."""

import errno
import os
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.reading.reader import Bag
from sain_bags.recovery import recover
from sain_bags.writing.split_file import SplitFile
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import OutputError

TEXT = "string data\n"
LATCHED = TopicQos(durability="transient_local")
PASSING = TopicQos(durability="transient_local", lifespan=(10, 0))
SECOND = 1_000_000_000


def topic(name: str, *offered: TopicQos, publishers: int = 1) -> Topic:
    return Topic(name, "std_msgs/msg/String", TEXT, "", offered or (TopicQos(),), publishers)


def text(value: int) -> bytes:
    word = f"{value:08d}".encode()
    return b"\x00\x01\x00\x00\x09\x00\x00\x00" + word + b"\x00"


def record(folder: Path, config: BagConfig, count: int = 200) -> BagWriter:
    """Record ten messages a second; two of a latched topic, before the others."""
    with BagWriter(folder, config) as writer:
        for one in (topic("/chat"), topic("/goal", LATCHED), topic("/rosout", PASSING)):
            writer.add_topic(one)
        for number, name in enumerate(("/goal", "/goal", "/rosout")):
            writer.write(name, text(number), SECOND + number, SECOND, number + 1)
        for number in range(count):
            time = SECOND + number * SECOND // 10
            writer.write("/chat", text(number), time + 10, time, number + 1)
    return writer


def contents(file: Path) -> list[tuple[str, bytes]]:
    with file.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages()
        return [(channel.topic, message.data) for _, channel, message in found]


def test_files_end_at_their_size(tmp_path: Path) -> None:
    record(tmp_path / "bag", BagConfig(split_size=8_000, chunk_size=1024, compression="none"), 900)
    sizes = [file.stat().st_size for file in (tmp_path / "bag").glob("*.mcap")]
    assert len(sizes) > 5
    assert max(sizes) < 8_000 + 8_000  # with what ends a file


def test_what_is_latched_stands_at_the_head_of_each_file(tmp_path: Path) -> None:
    writer = record(tmp_path / "bag", BagConfig(split_duration=5.0))
    for number in range(1, 4):
        messages = contents(tmp_path / "bag" / f"bag_{number}.mcap")
        assert messages[0] == ("/goal", text(1))  # the last one, not the first
        assert {name for name, _ in messages[1:]} == {"/chat"}  # what passes is not latched
    assert writer.counts == {"/chat": 200, "/goal": 2, "/rosout": 1}  # repeats are no messages


def test_metadata_tells_of_each_file_as_rosbag2_does(tmp_path: Path) -> None:
    record(tmp_path / "bag", BagConfig(split_duration=5.0))
    files = [tmp_path / "bag" / f"bag_{number}.mcap" for number in range(4)]
    chat = [[data for name, data in contents(file) if name == "/chat"] for file in files]
    assert chat == [[text(50 * number + one) for one in range(50)] for number in range(4)]
    content = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text(encoding="utf-8"))
    about = content["rosbag2_bagfile_information"]
    names = [f"bag_{number}.mcap" for number in range(4)]
    assert about["relative_file_paths"] == names
    assert [file["path"] for file in about["files"]] == names
    assert [file["message_count"] for file in about["files"]] == [53, 51, 51, 51]
    assert about["message_count"] == 206
    starts = [file["starting_time"]["nanoseconds_since_epoch"] for file in about["files"]]
    assert starts == [SECOND, *(SECOND + 5 * SECOND * n + 10 for n in range(1, 4))]
    assert [file["duration"]["nanoseconds"] for file in about["files"][1:]] == [4_900_000_000] * 3
    assert about["starting_time"]["nanoseconds_since_epoch"] == SECOND
    assert about["duration"]["nanoseconds"] == 19_900_000_010
    counts = {
        one["topic_metadata"]["name"]: one["message_count"]
        for one in about["topics_with_message_count"]
    }
    assert counts == {"/chat": 200, "/goal": 5, "/rosout": 1}
    with AnyReader([tmp_path / "bag"]) as reader:
        found = [(connection.topic, time, raw) for connection, time, raw in reader.messages()]
    bag = Bag(tmp_path / "bag")
    bag.check()
    assert [(one.topic, one.log_time, one.data) for one in bag.raw_messages()] == found


def test_a_disk_that_fails_while_a_file_is_ended_stops_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    writer = BagWriter(tmp_path / "bag", BagConfig(split_duration=1.0))
    writer.add_topic(topic("/chat"))
    writer.write("/chat", text(1), SECOND)
    monkeypatch.setattr(SplitFile, "close", fail)
    with pytest.raises(OutputError, match="Input/output error"):
        for number in range(2, 1000):
            writer.write("/chat", text(number), SECOND * number)
            writer.flush()
    monkeypatch.undo()
    with pytest.raises(OutputError, match="Input/output error"):
        writer.close()
    assert not (tmp_path / "bag" / "metadata.yaml").exists()  # one file is not whole


def test_a_split_recording_that_was_killed_is_recovered(tmp_path: Path) -> None:
    record(tmp_path / "bag", BagConfig(split_duration=5.0))
    (tmp_path / "bag" / "metadata.yaml").unlink()
    last = tmp_path / "bag" / "bag_3.mcap"
    last.write_bytes(last.read_bytes()[:-3000])
    report = recover(tmp_path / "bag", tmp_path / "saved")
    assert [loss.partition(":")[0] for loss in report.losses] == ["bag_3.mcap"]
    assert Bag(tmp_path / "saved").message_count == report.span.messages >= 155
