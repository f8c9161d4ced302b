"""A recorder beside a node that publishes."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from sain_bags.reading.reader import Bag
from sain_bags.ros.record import drain
from sain_bags.ros.recorder import Recorder
from sain_bags.writing.selection import Selection
from sain_bags.writing.writer import BagConfig, BagWriter


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
