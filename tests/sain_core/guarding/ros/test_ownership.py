"""Of two processes that own a topic the later ends, and publishers elsewhere are reported."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from sain_core.errors import BusyError, OutputError
from sain_core.guarding.ros import ownership
from sain_core.guarding.ros.ownership import Ownership, refuse_peers, refuse_rivals
from sain_core.ros.qos import LATCHED
from sain_interfaces.msg import Goal

OWNER = """
import time
from rclpy.node import Node
from sain_core.ros.node_main import ros_context
from sain_core.guarding.ros.ownership import Ownership
from sain_interfaces.msg import Goal
with ros_context():
    node = Node("owner", namespace="sain")
    owned = Ownership(node, ("aim",))
    publisher = node.create_publisher(Goal, "aim", 1)
    print("owns", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def other(ros_domain: int) -> Iterator[Node]:
    """A node that stands for another process."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = Node("other", namespace="sain", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture
def node(graph) -> Node:
    return graph.add(Node("mine", namespace="sain", context=graph.context))


@contextmanager
def owner() -> Iterator["subprocess.Popen[str]"]:
    """A process that owns a topic, and is killed at the end."""
    command = [sys.executable, "-c", OWNER]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "owns\n"
        yield process
        process.kill()


def test_the_later_of_two_is_refused_with_the_number_of_the_first(graph, node):
    with owner() as first:
        expected = rf"process {first.pid} \(/sain/owner\) publishes /sain/aim already; stop it"
        with pytest.raises(BusyError, match=expected):
            Ownership(node, ("aim",))
        first.send_signal(signal.SIGSTOP)  # it may go on
        with pytest.raises(BusyError, match=expected):
            Ownership(node, ("aim",))
        Ownership(node, ("other",)).release()


def test_a_killed_process_owns_nothing_though_discovery_has_not_noticed(graph, node):
    with owner() as first:
        graph.wait(lambda: node.count_publishers("aim") == 1, "the publisher")
        first.send_signal(signal.SIGKILL)
        Ownership(node, ("aim",)).release()  # nobody has waited for its end yet


def test_a_publisher_elsewhere_is_reported(graph, node, other):
    owned = Ownership(node, ("aim",))
    node.create_publisher(Goal, "aim", 1)
    publisher = other.create_publisher(Goal, "aim", 1)
    graph.wait(owned.rival, "its name")
    assert owned.rival().startswith("/sain/other publishes /sain/aim, too; stop it")
    other.destroy_publisher(publisher)
    graph.wait(lambda: not owned.rival(), "the end of the rival")


def test_a_rival_that_is_seen_late_is_refused(graph):
    first = graph.add(Node("first", namespace="sain", context=graph.context))
    refuse_peers(first, ("aim",))
    first.create_publisher(Goal, "aim", LATCHED)
    graph.wait(lambda: first.count_publishers("aim") == 1, "the first publisher")
    refuse_rivals(first, ("aim",))
    second = graph.add(Node("second", namespace="sain", context=graph.context))
    second.create_publisher(Goal, "aim", LATCHED)
    graph.wait(lambda: first.count_publishers("aim") == 2, "the second publisher")
    expected = "/sain/first and /sain/second publish /sain/aim, so another graph is running already"
    with pytest.raises(BusyError, match=expected):
        refuse_rivals(first, ("aim",))


@pytest.mark.parametrize("what", ["FIFO", "link"])
def test_what_is_no_regular_file_is_named(node, what, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(ownership, "private_folder", lambda: tmp_path)
    path = tmp_path / f"domain_{node.context.get_domain_id()}.sain.aim.lock"
    os.mkfifo(path) if what == "FIFO" else path.symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match=rf"cannot lock {path}: "):
        Ownership(node, ("aim",))
    assert not (tmp_path / "victim").exists()
