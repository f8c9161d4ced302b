"""Bags are what rosbag2 would have written, by the word of readers that are not ours."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.mcap.preallocated_file import RESERVE
from sain_bags.reading.reader import Bag
from sain_bags.recovery import recover
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import OutputError
from tests.sain_bags.doctor import examine

TEXT = Topic("/chat", "std_msgs/msg/String", "string data\n", "RIHS01_ab", (TopicQos(),))
HELLO = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00"


def test_rosbag2_layout_names_topics_counts_qos_and_times(record: Callable[..., Any]) -> None:
    recording = record(custom_data={"seed": "7", "model": "sain"})
    latched = TopicQos(durability="transient_local")
    recording.writer.add_topic(recording.messages.topic("/sain/goal", "sain_interfaces/msg/Goal"))
    recording.add("/sain/scene", "Scene")
    recording.add("/sain/scene", "Scene")
    late = recording.messages.topic(
        "/sain/goal", "sain_interfaces/msg/Goal", offered_qos=(TopicQos(), latched)
    )
    recording.writer.add_topic(late)  # a second publisher came later
    recording.writer.close()
    with Reader(recording.writer.folder) as reader:
        connections = {connection.topic: connection for connection in reader.connections}
        assert reader.message_count == 2
        assert reader.duration == 100_000_001  # rosbags counts the last nanosecond
        assert reader.storage.metadata.custom == {"seed": "7", "model": "sain"}
        assert reader.ros_distro == "jazzy"
    assert connections["/sain/scene"].msgcount == 2
    assert connections["/sain/scene"].digest.startswith("RIHS01_")
    profiles = connections["/sain/goal"].ext.offered_qos_profiles
    assert [qos.durability for qos in profiles] == [
        QosDurability.VOLATILE,
        QosDurability.TRANSIENT_LOCAL,
    ]
    assert profiles[0].reliability == QosReliability.RELIABLE


class SmallDisk:
    """Stands in for `os.write` on a disk of limited size that the reserve takes space of."""

    def __init__(self, capacity: int, folder: Path) -> None:
        self.capacity, self.folder, self.write_for_real = capacity, folder, os.write

    def write(self, descriptor: int, data: memoryview) -> int:
        used = sum(path.stat().st_size for path in self.folder.rglob("*") if path.is_file())
        space = self.capacity - used
        if space <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return self.write_for_real(descriptor, data[:space])


def test_a_full_disk_ends_in_a_clear_error_and_a_whole_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "write", SmallDisk(RESERVE + 200_000, tmp_path).write)
    writer = BagWriter(tmp_path / "bag", BagConfig(compression="none", chunk_size=16_384))
    writer.add_topic(TEXT)
    with pytest.raises(OutputError, match="no space left for the bag"), writer:
        for number in range(1, 10_000):
            writer.write("/chat", HELLO * 100, number, number)
    assert 50 < writer.counts["/chat"] < 1000
    bag = Bag(tmp_path / "bag")
    bag.check()
    assert bag.message_count == writer.counts["/chat"] == len(list(bag.raw_messages()))


def test_a_disk_that_is_nearly_full_ends_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = BagWriter(tmp_path / "bag", BagConfig(min_free_space=1))
    writer.add_topic(TEXT)
    writer.write("/chat", HELLO, 1)
    free = os.statvfs(tmp_path).f_bavail * os.statvfs(tmp_path).f_frsize
    monkeypatch.setattr(writer, "_config", BagConfig(min_free_space=2 * free))
    with pytest.raises(OutputError, match=r"MB are left on the disk .*\(--bag.min-free-space\)"):
        writer.flush()
    writer.close()
    assert Bag(tmp_path / "bag").message_count == 1
    with pytest.raises(OutputError, match="MB are left on the disk"):
        BagWriter(tmp_path / "other", BagConfig(min_free_space=2 * free))
    assert not (tmp_path / "other").exists()


def test_what_a_failed_write_left_behind_is_cut_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = BagWriter(tmp_path / "bag", BagConfig(compression="none", chunk_size=4096))
    writer.add_topic(TEXT)
    for number in range(100):
        writer.write("/chat", HELLO, number + 1)
    writer.flush()
    real, tries = os.write, []

    def fail(descriptor: int, data: memoryview) -> int:
        tries.append(len(data))
        if len(tries) == 1:
            return real(descriptor, data[:100])
        if len(tries) == 2:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return real(descriptor, data)

    monkeypatch.setattr(os, "write", fail)
    with pytest.raises(OutputError, match="Input/output error"), writer:
        for number in range(100, 1000):
            writer.write("/chat", HELLO, number + 1)
    assert tries[1] == tries[0] - 100
    assert examine(tmp_path / "bag" / "bag_0.mcap").message_count == 100
    assert [received.log_time for received in Bag(writer.folder).messages()] == [*range(1, 101)]
    assert (
        yaml.safe_load((writer.folder / "metadata.yaml").read_text(encoding="utf-8"))[
            "rosbag2_bagfile_information"
        ]["message_count"]
        == 100
    )


def test_events_are_read_without_what_comes_at_a_rate(record: Callable[..., Any]) -> None:
    recording = record()
    for _ in range(3):
        recording.add("/sain/scene", "Scene")
        recording.add("/sain/push", "Push")
    recording.writer.close()
    (file,) = recording.writer.folder.glob("*.mcap")
    assert examine(file).chunk_count == 2
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        stream.seek(0)
        messages = [(m.log_time, c.topic) for _, c, m in make_reader(stream).iter_messages()]
    assert summary is not None
    assert sorted(len(index.message_index_offsets) for index in summary.chunk_indexes) == [1, 1]
    own = [(one.log_time, one.topic) for one in Bag(file).messages()]
    assert own == messages == sorted(messages)
    assert {topic for _, topic in own[::2]} == {"/sain/scene"}


def test_an_open_bag_is_no_bag_yet(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag", BagConfig(flush_period=0.01))
    writer.add_topic(TEXT)
    writer.write("/chat", HELLO, 1, 1)
    writer.flush()
    assert not (tmp_path / "bag" / "metadata.yaml").exists()
    with pytest.raises(FileNotFoundError):
        Reader(tmp_path / "bag")
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:  # what was flushed can be saved
        found = []
        with pytest.raises(EndOfFile):
            for entry in StreamReader(stream).records:
                found.append(entry)
    assert any(isinstance(entry, Message) for entry in found)
    writer.close()
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == [
        "bag_0.mcap",
        "metadata.yaml",
    ]


def test_a_disk_full_from_the_start_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", no_space)
    with pytest.raises(OutputError, match="No space left on device"):
        BagWriter(tmp_path / "bag")
    assert not list(tmp_path.iterdir())


def test_what_a_recording_says_of_itself_survives_it(tmp_path: Path) -> None:
    """Nothing is closed: the recorder was killed."""
    writer = BagWriter(tmp_path / "bag", custom_data={"seed": "7"}, ros_distro="kilted")
    writer.add_topic(TEXT)
    writer.write("/chat", HELLO, 1)
    writer.flush()
    report = recover(tmp_path / "bag", tmp_path / "saved")
    writer.close()
    assert len(report.losses) == 1
    saved = Bag(tmp_path / "saved")
    assert saved.custom_data == {"seed": "7", "recovered": "with losses, from bag"}
    assert saved.metadata["ros_distro"] == "kilted"
