"""A bag played again: the same bytes on the same topics, offered as they were."""

import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, String

from sain_bags.bag.metadata import TopicQos
from sain_bags.playing import Passage, PlayOptions, choose_topics, play
from sain_bags.reading.reader import Bag, Raw
from sain_bags.ros.player import Player
from sain_bags.writing.writer import BagWriter
from sain_bringup.graph import executable
from tests.sain_bags.conftest import SECOND, START, Messages, Recording

pytestmark = pytest.mark.ros

LATCHED = TopicQos(durability="transient_local", depth=1)
LATE = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WORD = "std_msgs/msg/String"


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return Recording(BagWriter(tmp_path / "bag"), Messages())


def say(recording: Recording, topic: str, *words: str, **more: object) -> None:
    """Record words on a topic, 20 ms apart."""
    for word in words:
        message = recording.messages.make(WORD, data=word)
        data = bytes(recording.messages.store.serialize_cdr(message, WORD))
        recording.writer.add_topic(recording.messages.topic(topic, WORD, **more))
        recording.now += SECOND // 50
        recording.writer.write(topic, data, recording.now, recording.now)


def closed(recording: Recording) -> Bag:
    recording.writer.close()
    return Bag(recording.writer.folder)


class Spinning:
    """Goes on with the graph while the player waits."""

    def __init__(self, graph) -> None:
        self.graph, self.time = graph, 0.0

    def now(self) -> float:
        return self.time

    def wait(self, seconds: float) -> bool:
        self.time += seconds
        self.graph.executor.spin_once(timeout_sec=0.0)
        return False


@pytest.fixture
def player(graph) -> Callable[..., Player]:
    def start(bag: Bag, *topics: str, namespace: str = "") -> Player:
        return graph.add(Player(choose_topics(bag, topics), namespace, context=graph.context))

    return start


def play_all(graph, player: Player, bag: Bag, **config) -> None:
    settings = PlayOptions(Path(), **config)
    passage = Passage(bag, player.topics, settings, player.latched)
    play(passage.events(), player.publish, Spinning(graph))


def test_the_bytes_are_the_recorded_ones(graph, recording, player):
    say(recording, "/a", "one", "two", "three")
    say(recording, "/b", "four")
    bag = closed(recording)
    heard: list[tuple[str, bytes]] = []
    for topic in ("/a", "/b"):
        graph.bystander.create_subscription(
            String, topic, lambda data, topic=topic: heard.append((topic, data)), 10, raw=True
        )
    playing = player(bag)
    graph.wait(lambda: not playing.unheard(), "subscribers")
    play_all(graph, playing, bag)
    graph.wait(lambda: len(heard) == 4, "what was recorded")
    recorded: list[Raw] = list(bag.raw_messages())
    assert sorted(heard) == sorted((raw.topic, bytes(raw.data)) for raw in recorded)
    assert [data for topic, data in heard if topic == "/a"] == [
        bytes(raw.data) for raw in recorded if raw.topic == "/a"
    ]


def test_a_topic_is_offered_as_it_was(graph, recording, player):
    say(recording, "/goal", "here", offered_qos=(LATCHED,))
    say(recording, "/lossy", "x", offered_qos=(TopicQos(reliability="best_effort"),))
    say(recording, "/plain", "y")
    player(closed(recording))

    def offer(topic: str) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
        graph.wait(lambda: graph.bystander.get_publishers_info_by_topic(topic), topic)
        qos = graph.bystander.get_publishers_info_by_topic(topic)[0].qos_profile
        return qos.reliability, qos.durability

    sure, lossy = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
    assert offer("/goal") == (sure, DurabilityPolicy.TRANSIENT_LOCAL)
    assert offer("/lossy") == (lossy, DurabilityPolicy.VOLATILE)
    assert offer("/plain") == (sure, DurabilityPolicy.VOLATILE)


@pytest.fixture
def command(ros_domain: int) -> list[str]:
    return [str(executable("sain_bags", "play"))]


def test_the_command_plays_and_renames(graph, recording, command):
    offered = (TopicQos(depth=20),)  # the bag has 20: none is overwritten before it is delivered
    say(recording, "/a", *map(str, range(20)), offered_qos=offered)
    bag = closed(recording)
    heard: list[str] = []
    graph.bystander.create_subscription(String, "/b", lambda m: heard.append(m.data), 100)
    process = subprocess.Popen(
        [*command, str(bag.path), "--rate", "4", "--wait", "30", "--ros-args", "-r", "/a:=/b"],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    graph.wait(lambda: process.poll() is not None, "the end of play")
    graph.wait(lambda: len(heard) == 20, "all words")
    assert heard == [str(number) for number in range(20)]
    assert process.returncode == 0 and "Played 20 messages" in process.stdout.read()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_well(graph, recording, command, number):
    kind = "std_msgs/msg/Bool"
    recording.add("/flag", kind, data=True)
    heard: list[Bool] = []
    graph.bystander.create_subscription(Bool, "/flag", heard.append, 10)
    bag = closed(recording)
    process = subprocess.Popen(
        [*command, str(bag.path), "--loop", "--wait", "30"], stdout=subprocess.PIPE, text=True
    )
    graph.wait(lambda: len(heard) > 1, "the second time round")
    process.send_signal(number)
    assert process.wait(timeout=30) == 0
    assert "Stopped after" in process.stdout.read()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--topics", "/b"], "has no topic /b; it has /a"),
        (["--start", "99"], "it cannot be played from 99.000 s on"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(recording, command, arguments, message):
    say(recording, "/a", "one")
    bag = closed(recording)
    done = subprocess.run([*command, str(bag.path), *arguments], capture_output=True, text=True)
    assert done.returncode == 1 and message in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_who_comes_late_gets_what_is_latched(graph, recording, player):
    say(recording, "/goal", "first", "last", offered_qos=(LATCHED,))
    bag = closed(recording)
    play_all(graph, player(bag), bag)
    heard: list[str] = []
    graph.bystander.create_subscription(String, "/goal", lambda m: heard.append(m.data), LATE)
    graph.wait(lambda: heard, "the goal")
    assert heard == ["last"]


def test_time_is_published_where_it_was_not_recorded(graph, recording, player):
    say(recording, "/a", *map(str, range(10)))
    bag = closed(recording)
    heard: list[int] = []
    graph.bystander.create_subscription(
        Clock, "/clock", lambda m: heard.append(m.clock.sec * 10**9 + m.clock.nanosec), 100
    )
    playing = player(bag)
    playing.offer_clock()
    graph.wait(lambda: graph.bystander.count_publishers("/clock") == 1, "the clock")
    graph.wait(lambda: playing.count_subscribers("/clock") == 1, "who looks at it")
    play_all(graph, playing, bag, clock=100.0)
    graph.wait(lambda: len(heard) >= 19, "the time")
    assert heard == [START + SECOND // 50 + n * SECOND // 100 for n in range(19)]
