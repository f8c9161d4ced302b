"""The recorder takes every topic as it appears, whatever its publishers offer."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from rcl_interfaces.srv import ListParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from sain_bags.cli.info import warnings_about
from sain_bags.reading.reader import Bag
from sain_bags.reading.timing import read_timings
from sain_bags.ros.endpoints import message_class
from sain_bags.ros.handshake import Handshake
from sain_bags.ros.record import (
    PATIENCE,
    REST,
    Readiness,
    about_silence,
    drain,
    parse_custom_data,
)
from sain_bags.ros.recorder import Recorder
from sain_bags.writing.selection import Selection
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core import notify
from sain_core.errors import ConfigError, InvalidInputError
from sain_interfaces.msg import DiskState, Scene

pytestmark = pytest.mark.ros

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOSSY = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class Studio:
    """A recorder, and a node that publishes."""

    def __init__(self, context: rclpy.Context, folder: Path) -> None:
        self.executor = SingleThreadedExecutor(context=context)
        self.writer = BagWriter(folder, BagConfig(flush_period=0.2))
        self.context = context
        self.player = Node("player", context=context)
        self.executor.add_node(self.player)

    def start(self, *chosen: str) -> None:
        self.recorder = Recorder(self.writer, Selection(chosen), context=self.context)

    def spin_until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain; so far {self.writer.counts}"
            self.recorder.work()
            self.executor.spin_once(timeout_sec=0.01)

    def recorded(self, topic: str, count: int) -> None:
        """Spin until so many messages of a topic are in the bag."""
        self.spin_until(lambda: self.writer.counts.get(topic, 0) >= count)

    def listened(self, topic: str) -> None:
        """Spin until the recorder listens to a topic."""
        self.spin_until(lambda: self.player.count_subscribers(topic) > 0)

    def end(self) -> Bag:
        drain(self.recorder)
        self.executor.remove_node(self.player)
        for node in (self.recorder, self.player):
            node.destroy_node()
        self.writer.close()
        return Bag(self.writer.folder)


@pytest.fixture
def studio(ros_domain: int, tmp_path: Path) -> Iterator[Studio]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield Studio(context, tmp_path / "bag")
    rclpy.try_shutdown(context=context)


def test_topics_that_appear_late_are_recorded(studio: Studio) -> None:
    studio.start()
    early = studio.player.create_publisher(String, "early", 10)
    studio.listened("/early")
    early.publish(String(data="first"))
    studio.recorded("/early", 1)
    late = studio.player.create_publisher(Scene, "late", 10)
    studio.listened("/late")
    late.publish(Scene(scene_id=7, disks=[DiskState(x=0.5), DiskState()]))
    studio.recorded("/late", 1)
    bag = studio.end()
    (scene,) = (received.message for received in bag.messages(["/late"]))
    assert (scene.scene_id, scene.disks[0].x) == (7, 0.5)
    assert {"/early", "/late", "/rosout"} <= {topic.name for topic in bag.topics}


def test_it_answers_what_its_parameters_are(studio: Studio) -> None:
    studio.start()
    client = studio.player.create_client(ListParameters, "/recorder/list_parameters")
    studio.spin_until(client.service_is_ready)
    answer = client.call_async(ListParameters.Request())
    studio.spin_until(answer.done)
    assert "use_sim_time" in answer.result().result.names


class Warnings:
    """In the place of a node's logger."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def warning(self, text: str) -> None:
        self.texts.append(text)


def test_absent_topics_and_undefined_types_are_warned_of_and_listed(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sain_bags.ros.recorder.ABSENCE_TIME", 0.1)
    monkeypatch.setattr("sain_bags.ros.recordable_types.Definitions.joined", lambda *_: "")
    studio.start("/said", "/never")
    warnings = Warnings()
    monkeypatch.setattr(studio.recorder, "get_logger", lambda: warnings)
    said = studio.player.create_publisher(String, "said", 10)
    studio.listened("/said")
    said.publish(String(data="word"))
    studio.recorded("/said", 1)
    studio.spin_until(lambda: len(warnings.texts) > 1)
    assert sorted(warnings.texts) == [
        "/never was asked for, and nobody publishes it",
        "/said is recorded without a definition of std_msgs/msg/String: its node gave none",
    ]
    studio.writer.custom_data.update(about_silence(studio.recorder, ("/never",)))
    bag = studio.end()
    assert list(warnings_about(bag)) == [
        "No message came on /never",
        "Without a definition of their messages: /said",
        "Missing messages are counted from the first of each topic",
    ]


def test_what_was_latched_before_is_recorded(studio: Studio) -> None:
    studio.player.create_publisher(String, "goal", LATCHED).publish(String(data="before"))
    studio.start()
    studio.recorded("/goal", 1)
    (received,) = studio.end().messages(["/goal"])
    assert received.message.data == "before"
    assert received.publish_time <= received.log_time


def test_best_effort_is_recorded_also_when_it_joins_a_reliable_topic(studio: Studio) -> None:
    studio.start()
    studio.player.create_publisher(Clock, "/clock", 10)
    studio.listened("/clock")
    lossy = studio.player.create_publisher(Clock, "/clock", LOSSY)

    def tick() -> bool:
        lossy.publish(Clock())
        return studio.writer.counts.get("/clock", 0) > 0

    studio.spin_until(tick)
    with AnyReader([studio.end().path]) as reader:
        offered = next(c for c in reader.connections if c.topic == "/clock")
        assert {qos.reliability.name for qos in offered.ext.offered_qos_profiles} == {
            "RELIABLE",
            "BEST_EFFORT",
        }


def test_a_burst_is_recorded_whole_and_in_order(studio: Studio) -> None:
    studio.start()
    burst = studio.player.create_publisher(String, "burst", 500)
    studio.listened("/burst")
    for number in range(500):
        burst.publish(String(data=str(number)))
    studio.recorded("/burst", 500)
    data = [received.message.data for received in studio.end().messages(["/burst"])]
    assert data == [str(number) for number in range(500)]


def test_hidden_topics_and_those_not_chosen_are_left_out(studio: Studio) -> None:
    studio.start("/chosen")
    topics = ("/chosen", "/other", "/_hidden")
    publishers = [studio.player.create_publisher(String, name, LATCHED) for name in topics]
    for publisher in publishers:
        publisher.publish(String(data="x"))
    studio.recorded("/chosen", 1)
    assert [topic.name for topic in studio.end().topics] == ["/chosen"]


def test_rosbags_finds_the_type_hash_that_it_computes_itself(studio: Studio) -> None:
    studio.start("/scene")
    studio.player.create_publisher(Scene, "/scene", LATCHED).publish(Scene(episode_id=3))
    studio.recorded("/scene", 1)
    with AnyReader([studio.end().path]) as reader:  # raises when the hashes differ
        (found,) = [
            reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()
        ]
    assert found.episode_id == 3


def test_types_that_are_not_installed_are_named() -> None:
    assert message_class("sain_interfaces/msg/Scene") is Scene
    with pytest.raises(InvalidInputError, match="sain_interfaces/msg/Nothing is not installed"):
        message_class("sain_interfaces/msg/Nothing")
    with pytest.raises(InvalidInputError, match="no_such/msg/Thing is not installed"):
        message_class("no_such/msg/Thing")


def test_custom_data_must_be_pairs() -> None:
    assert parse_custom_data(("a=1", "b=x=y")) == {"a": "1", "b": "x=y"}
    with pytest.raises(ConfigError, match="'nonsense'; it must be KEY=VALUE"):
        parse_custom_data(("nonsense",))


def test_what_is_latched_is_recorded_once_though_it_is_subscribed_to_anew(studio: Studio) -> None:
    studio.start()
    studio.player.create_publisher(String, "goal", LATCHED).publish(String(data="the goal"))
    studio.recorded("/goal", 1)

    def asks_for(durability: DurabilityPolicy) -> bool:
        found = studio.player.get_subscriptions_info_by_topic("/goal")
        return [info.qos_profile.durability for info in found] == [durability]

    passing = studio.player.create_publisher(String, "goal", 10)
    studio.spin_until(lambda: asks_for(DurabilityPolicy.VOLATILE))
    studio.player.destroy_publisher(passing)
    studio.spin_until(lambda: asks_for(DurabilityPolicy.TRANSIENT_LOCAL))
    marker = studio.player.create_publisher(String, "marker", LATCHED)
    marker.publish(String(data="later"))
    studio.recorded("/marker", 1)
    for _ in range(50):  # what was latched would have come by now
        studio.recorder.work()
        time.sleep(0.01)
    recorder_gaps = studio.recorder.gaps["/goal"]
    assert [received.message.data for received in studio.end().messages(["/goal"])] == ["the goal"]
    assert recorder_gaps.missing == 0


def test_a_message_that_never_came_is_counted(studio: Studio) -> None:
    studio.start()
    numbers = studio.player.create_publisher(String, "numbers", LOSSY)
    studio.listened("/numbers")
    for number in range(3):
        numbers.publish(String(data=str(number)))
    studio.recorded("/numbers", 3)
    subscription = studio.recorder._recorded["/numbers"].subscription
    assert subscription is not None
    numbers.publish(String(data="lost"))
    lost: list[object] = []

    def steal() -> bool:
        with subscription.handle:
            lost.extend(filter(None, [subscription.handle.take_message(String, True)]))
        return bool(lost)

    deadline = time.monotonic() + 30.0
    while not steal():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    numbers.publish(String(data="found"))
    studio.recorded("/numbers", 4)
    gaps = studio.recorder.gaps["/numbers"]
    assert (gaps.missing, gaps.is_exact) == (1, True)
    bag = studio.end()
    assert read_timings(bag)["/numbers"].missing == 1  # as the bag itself shows


def test_a_node_answers_the_handshake_only_once_it_works(studio: Studio) -> None:
    studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")

    def work(seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            studio.recorder.work()
            handshake.work()

    handshake = Handshake(studio.recorder, ["/player", "/player"])
    work(1.0)  # it is there, and asked, and handles nothing
    assert not handshake.is_complete
    studio.spin_until(lambda: (handshake.work(), handshake.is_complete)[1])
    assert studio.player.count_subscribers("/chatter") == 1
    studio.end()


def test_the_recorder_asks_who_publishes_what_it_records_and_no_one_else(studio: Studio) -> None:
    studio.player.create_publisher(String, "/chatter", 10)
    other = Node("other", namespace="/far/away", context=studio.context)
    other.create_publisher(String, "/whisper", 10)
    studio.executor.add_node(other)
    studio.start("/chatter")
    studio.listened("/chatter")
    studio.spin_until(lambda: studio.recorder.owners() == {"/player"})
    other.create_publisher(String, "/chatter", 10)
    studio.spin_until(lambda: studio.recorder.owners() == {"/player", "/far/away/other"})
    studio.executor.remove_node(other)
    other.destroy_node()
    studio.end()


def test_a_recorder_is_ready_once_all_have_found_it_or_after_a_while(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[float] = []
    monkeypatch.setattr(notify, "ready", lambda: told.append(time.monotonic()))
    chatter = studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")
    studio.listened("/chatter")
    begun = time.monotonic()
    readiness = Readiness(studio.recorder, begun)

    def work(seconds: float, answers: bool) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            chatter.publish(String(data="hello"))
            readiness.work(studio.recorder.work())
            if answers:
                studio.executor.spin_once(timeout_sec=0.01)
            time.sleep(0.01)

    work(REST + 0.5, answers=False)
    assert told == []
    work(1.0, answers=True)
    assert len(told) == 1
    readiness = Readiness(studio.recorder, begun)
    begun = time.monotonic()
    work(REST + PATIENCE + 0.5, answers=False)
    assert len(told) == 2
    assert told[1] - begun >= REST + PATIENCE
    studio.end()
