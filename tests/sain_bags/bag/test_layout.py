"""Every byte of a bag is where the specifications of MCAP and of rosbag2's layout want it."""

from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.reading.reader import Bag
from sain_bags.writing.gaps import MISSING_KEY
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.randomness import generator
from tests.sain_bags.doctor import examine

LATCHED = (TopicQos(durability="transient_local"),)
TOPICS = (
    Topic("/chat", "std_msgs/msg/String", "string data\n", "RIHS01_ab", (TopicQos(),)),
    Topic("/goal", "std_msgs/msg/String", "string data\n", "RIHS01_ab", LATCHED),
    Topic("/silent", "std_msgs/msg/Empty", "\n", "RIHS01_cd", (TopicQos(),)),
)
LATE = Topic("/late", "test/msg/Late", "uint8[] data\n")


def record(folder: Path, config: BagConfig, messages: int = 400) -> BagWriter:
    random = generator(3)
    with BagWriter(folder, config, {"seed": "7"}) as writer:
        for topic in TOPICS:
            writer.add_topic(topic)
        for number in range(messages):
            if number == messages // 2:
                writer.add_topic(LATE)
            name = "/goal" if number % 100 == 5 else "/late" if number > 300 else "/chat"
            data = bytes(4) + random.bytes(int(random.integers(300)))
            time = 10**18 + 10_000_000 * number + int(random.integers(20_000_000))
            writer.write(name, data, time, time - 500, number + 1)
        writer.custom_data[MISSING_KEY] = "{}"
    return writer


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
@pytest.mark.parametrize("messages", [0, 1, 400])
def test_every_record_is_where_it_should_be(
    compression: str, messages: int, tmp_path: Path
) -> None:
    record(tmp_path / "bag", BagConfig(compression=compression, chunk_size=4096), messages)
    statistics = examine(tmp_path / "bag" / "bag_0.mcap")
    assert statistics.message_count == messages
    assert statistics.chunk_count == {0: 0, 1: 1, 400: 19}[messages]
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        summary, found = reader.get_summary(), list(reader.iter_messages())
        assert reader.get_header().profile == "ros2"
    assert summary is not None
    named = {"" if compression == "none" else compression} if messages else set()
    assert {chunk.compression for chunk in summary.chunk_indexes} == named
    for schema, channel, message in found:
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
        assert (message.log_time - 10**18) // 10_000_000 - message.sequence in (-1, 0, 1)
        (topic,) = [one for one in (*TOPICS, LATE) if one.name == channel.topic]
        assert (schema.name, channel.metadata["topic_type_hash"]) == (topic.type, topic.type_hash)
        profiles = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert [one["durability"] for one in profiles] == [q.durability for q in topic.offered_qos]


def test_metadata_has_all_that_rosbag2_writes_and_nothing_else(tmp_path: Path) -> None:
    """Names from rosbag2_storage/yaml.hpp and metadata_io.cpp, version 9."""
    record(tmp_path / "bag", BagConfig())
    content = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text(encoding="utf-8"))
    (about,) = content.values()
    assert set(about) == {
        "version", "storage_identifier", "duration", "starting_time", "message_count",
        "topics_with_message_count", "compression_format", "compression_mode",
        "relative_file_paths", "files", "custom_data", "ros_distro",
    }  # fmt: skip
    assert set(about["files"][0]) == {"path", "starting_time", "duration", "message_count"}
    topic = about["topics_with_message_count"][1]["topic_metadata"]
    assert set(topic) == {
        "name", "type", "serialization_format", "offered_qos_profiles", "type_description_hash",
    }  # fmt: skip
    assert set(topic["offered_qos_profiles"][0]) == {
        "history", "depth", "reliability", "durability", "deadline", "lifespan", "liveliness",
        "liveliness_lease_duration", "avoid_ros_namespace_conventions",
    }  # fmt: skip


def test_a_topic_that_nobody_could_define_keeps_no_reader_from_the_others(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(Topic("/known", "std_msgs/msg/String", "string data\n"))
        writer.add_topic(Topic("/unknown", "a/msg/Thing", "", "RIHS01_ab"))
        writer.write("/known", b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00", 10**18)
        writer.write("/unknown", b"\x00\x01\x00\x00\x07", 10**18 + 1)
    examine(tmp_path / "bag" / "bag_0.mcap")
    with AnyReader([tmp_path / "bag"]) as reader:
        found = [(connection.msgtype, raw) for connection, _, raw in reader.messages()]
        assert reader.deserialize(found[0][1], found[0][0]).data == "hi"
    assert found[1] == ("a/msg/Thing", b"\x00\x01\x00\x00\x07")
    assert [raw.type for raw in Bag(tmp_path / "bag").raw_messages()] == [name for name, _ in found]
