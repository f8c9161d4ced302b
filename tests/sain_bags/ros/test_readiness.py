"""A recorder is ready when all nodes whose topics it records have found it."""

import json
import time
from pathlib import Path

import pytest
from rclpy.node import Node
from std_msgs.msg import String

from sain_bags.ros import readiness as module
from sain_bags.ros.readiness import NODES, PATIENCE, REST, Handshake, NodesFile, Readiness
from sain_core.guarding import lifetime
from tests.sain_bags.ros.conftest import Studio

pytestmark = pytest.mark.ros


def test_a_node_answers_the_handshake_only_once_it_works(studio: Studio) -> None:
    studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")

    def work(seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            studio.recorder.work()
            handshake.work()

    handshake = Handshake(studio.recorder)
    handshake.begin(["/player", "/player"])
    work(1.0)  # it is there, and asked, and handles nothing
    assert not handshake.is_complete
    studio.spin_until(lambda: (handshake.work(), handshake.is_complete)[1])
    assert studio.player.count_subscribers("/chatter") == 1
    studio.end()


def test_a_node_that_starts_slowly_answers_nobody_who_is_gone(
    studio: Studio, recwarn: pytest.WarningsRecorder
) -> None:
    """It takes the questions that came while it was busy, one after another, and all at once."""
    studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")
    handshake, begun = Handshake(studio.recorder), time.monotonic()
    for seconds in (0.0, 1.2):  # asked, and asked anew
        while time.monotonic() < begun + seconds:
            handshake.work()
        handshake.begin(["/player"])
    while time.monotonic() < begun + 2.4:
        handshake.work()
    handshake.end()
    while handshake.is_waiting:
        handshake.work()
        studio.executor.spin_once(timeout_sec=0.1)
    assert [str(warning.message) for warning in recwarn] == []
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
    monkeypatch.setattr(lifetime, "ready", lambda: told.append(time.monotonic()))
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


def test_a_recorder_that_goes_on_waits_for_the_nodes_that_were_there_before(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[float] = []
    monkeypatch.setattr(lifetime, "ready", lambda: told.append(time.monotonic()))
    chatter = studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")
    studio.listened("/chatter")
    before = frozenset({"/player", "/other"})
    readiness = Readiness(studio.recorder, time.monotonic(), before)

    def work(seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            chatter.publish(String(data="hello"))
            readiness.work(studio.recorder.work())
            studio.executor.spin_once(timeout_sec=0.01)

    work(REST + 1.0)
    assert told == []
    other = Node("other", context=studio.context)
    other.create_publisher(String, "/chatter", 10)
    studio.executor.add_node(other)
    work(1.0)
    assert len(told) == 1
    studio.executor.remove_node(other)
    other.destroy_node()
    studio.end()


def test_the_names_of_nodes_outlive_a_recorder_that_is_killed(
    studio: Studio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "NODES_PERIOD", 0.0)
    studio.player.create_publisher(String, "/chatter", 10)
    studio.start("/chatter")
    studio.spin_until(lambda: studio.recorder.owners() == {"/player"})
    (tmp_path / NODES).write_text(json.dumps(["/other"]))
    nodes = NodesFile(tmp_path)
    assert nodes.before == {"/other"}
    nodes.work(studio.recorder, found_all=False)
    assert NodesFile(tmp_path).before == {"/other", "/player"}
    nodes.work(studio.recorder, found_all=True)
    assert NodesFile(tmp_path).before == {"/player"}
    nodes.remove()
    assert list(tmp_path.glob(NODES)) == []
    studio.end()


@pytest.mark.parametrize("text", ["", "{", "3", "[[[", "null"])
def test_a_damaged_file_of_names_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / NODES).write_text(text)
    assert NodesFile(tmp_path).before == frozenset()
