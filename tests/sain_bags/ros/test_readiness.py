"""A recorder is ready when all nodes whose topics it records have found it."""

import time

import pytest
from rclpy.node import Node
from std_msgs.msg import String

from sain_bags.ros.readiness import PATIENCE, REST, Readiness
from sain_core.guarding import lifetime
from tests.sain_bags.ros.conftest import Studio

pytestmark = pytest.mark.ros


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
