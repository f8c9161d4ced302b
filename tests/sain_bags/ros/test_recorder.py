"""The recorder takes every topic as it appears, whatever its publishers offer."""

import sys
import time
from threading import Timer
from types import SimpleNamespace

import pytest
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from sain_bags.cli.info import warnings_about
from sain_bags.reading.timing import read_timings
from sain_bags.ros.record import PATIENCE, SILENCE, Readiness, about_silence
from sain_bags.ros.recorder import Recorder
from sain_core.guarding import lifetime
from sain_interfaces.msg import DiskState, Scene
from tests.sain_bags.ros.conftest import Studio

pytestmark = pytest.mark.ros

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOSSY = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


def begun(studio: Studio) -> Publisher:
    """Record a first message; return its publisher."""
    studio.start()
    early = studio.player.create_publisher(String, "early", 10)
    studio.listened("/early")
    early.publish(String(data="first"))
    studio.recorded("/early", 1)
    return early


def test_topics_that_appear_late_are_recorded(studio: Studio) -> None:
    begun(studio)
    late = studio.player.create_publisher(Scene, "late", 10)
    studio.listened("/late")
    late.publish(Scene(scene_id=7, disks=[DiskState(x=0.5), DiskState()]))
    studio.recorded("/late", 1)
    bag = studio.end()
    (scene,) = (received.message for received in bag.messages(["/late"]))
    assert (scene.scene_id, scene.disks[0].x) == (7, 0.5)
    assert {"/early", "/late", "/rosout"} <= {topic.name for topic in bag.topics}


def test_what_comes_a_little_after_the_stop_is_recorded(studio: Studio) -> None:
    """As where a packet was dropped, and is sent again."""
    early = begun(studio)
    Timer(0.15, early.publish, [String(data="last")]).start()
    said = [received.message.data for received in studio.end().messages(["/early"])]
    assert said == ["first", "last"]


class Warnings:
    """In the place of a node's logger."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def warning(self, text: str) -> None:
        self.texts.append(text)


def test_absent_topics_and_types_that_are_not_installed_are_warned_of_and_listed(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sain_bags.ros.recorder.ABSENCE_TIME", 0.1)
    monkeypatch.setitem(sys.modules, "rosgraph_msgs.msg", None)
    studio.start("/said", "/never", "/strange")
    warnings = Warnings()
    monkeypatch.setattr(studio.recorder, "get_logger", lambda: warnings)
    said = studio.player.create_publisher(String, "said", 10)
    studio.listened("/said")
    said.publish(String(data="word"))
    studio.recorded("/said", 1)
    studio.player.create_publisher(Clock, "strange", 10)
    studio.spin_until(lambda: len(warnings.texts) == 2)
    (absent,) = [text for text in warnings.texts if text.startswith("/never")]
    assert absent == "/never was asked for, and nobody publishes it"
    (strange,) = [text for text in warnings.texts if text.startswith("/strange is not recorded")]
    assert strange.endswith(
        "rosgraph_msgs/msg/Clock is not installed (import of rosgraph_msgs.msg halted; None in"
        " sys.modules)"
    )
    studio.writer.custom_data.update(about_silence(studio.recorder, ("/never",)))
    bag = studio.end()
    assert list(warnings_about(bag)) == [
        "No message came on /never",
        "Not recorded: /strange",
        "Missing messages are counted from the first of each topic",
    ]


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
    assert (
        read_timings(bag)["/numbers", "std_msgs/msg/String"].missing == 1
    )  # as the bag itself shows


def test_a_recorder_reports_that_it_is_ready_once_all_publishers_are_connected(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports: list[float] = []
    monkeypatch.setattr(lifetime, "ready", lambda: reports.append(time.monotonic()))
    chatter = studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")
    readiness = Readiness(studio.recorder, begun := time.monotonic())
    while not reports:
        chatter.publish(String(data="hello"))
        readiness.work(studio.recorder.work())
        time.sleep(0.01)
        assert time.monotonic() < begun + SILENCE + PATIENCE
    assert studio.recorder.unmatched == []
    readiness.work(1)
    assert len(reports) == 1
    studio.end()


def test_what_was_latched_before_is_recorded(studio: Studio) -> None:
    studio.player.create_publisher(String, "goal", LATCHED).publish(String(data="before"))
    studio.start()
    studio.recorded("/goal", 1)
    (received,) = studio.end().messages(["/goal"])
    assert received.message.data == "before"
    assert received.publish_time <= received.log_time


def test_topics_that_are_never_connected_are_named(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Recorder, "unmatched", ["/a", "/b"])
    studio.start("/chatter")
    reports: list[str] = []
    monkeypatch.setattr(lifetime, "ready", lambda: reports.append("ready"))
    logger = SimpleNamespace(warning=reports.append)
    monkeypatch.setattr(studio.recorder, "get_logger", lambda: logger)
    Readiness(studio.recorder, time.monotonic() - SILENCE).work(0)
    assert reports == []
    Readiness(studio.recorder, time.monotonic() - SILENCE - PATIENCE).work(0)
    assert reports == [
        "not all publishers of /a, /b are connected; messages may be missing",
        "ready",
    ]
    studio.end()


def test_rosbags_finds_the_type_hash_that_it_computes_itself(studio: Studio) -> None:
    studio.start("/scene")
    studio.player.create_publisher(Scene, "/scene", LATCHED).publish(Scene(episode_id=3))
    studio.recorded("/scene", 1)
    with AnyReader([studio.end().path]) as reader:  # raises when the hashes differ
        (found,) = [
            reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()
        ]
    assert found.episode_id == 3
