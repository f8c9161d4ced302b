"""One graph in each namespace of a domain, and one publisher of each of its topics."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import String

from sain_core.errors import BusyError, OutputError
from sain_core.guarding.ros import ownership
from sain_core.guarding.ros.ownership import find_second_publisher, lock_name, lock_namespace

OWNER = """
import time
from rclpy.node import Node
from sain_core.ros.node_main import ros_context
from sain_core.guarding.ros.ownership import lock_namespace
with ros_context():
    node = Node("owner", namespace="sain")
    lock_namespace(node)
    print("owns", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def other(ros_domain):
    """A node that stands for another process."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = Node("other", namespace="sain", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture
def node(graph):
    return graph.add(Node("mine", namespace="sain", context=graph.context))


@contextmanager
def owner() -> Iterator["subprocess.Popen[str]"]:
    """A process that locks the namespace, and is killed at the end."""
    command = [sys.executable, "-c", OWNER]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "owns\n"
        yield process
        process.kill()


def test_the_later_of_two_is_refused_with_the_number_of_the_first(graph, node):
    domain = node.context.get_domain_id()
    with owner() as first:
        expected = re.escape(
            f"process {first.pid} (/sain/owner) executes pushes in namespace /sain of domain"
            f" {domain} already; stop it, or start this one with another ROS_DOMAIN_ID or namespace"
        )
        with pytest.raises(BusyError, match=expected):
            lock_namespace(node)
        first.send_signal(signal.SIGSTOP)  # it may go on
        with pytest.raises(BusyError, match=expected):
            lock_namespace(node)
        lock_namespace(graph.add(Node("mine", namespace="lab", context=graph.context)))()


def test_a_killed_process_has_no_lock_though_discovery_has_not_noticed(node):
    with owner() as first:
        first.send_signal(signal.SIGKILL)
        lock_namespace(node)()  # nobody has waited for its end yet


def test_a_second_publisher_is_named_until_it_ends(graph, node, other):
    for topic in ("aim", "/clock"):
        node.create_publisher(String, topic, 1)
        assert find_second_publisher(node, (topic,)) == ""
        publisher = other.create_publisher(String, topic, 1)
        graph.wait(lambda topic=topic: node.count_publishers(topic) == 2, "the second publisher")
        graph.wait(
            lambda topic=topic: "not known" not in find_second_publisher(node, (topic,)), "its name"
        )
        name = node.resolve_topic_name(topic)
        expected = f"/sain/mine and /sain/other publish {name}; there must be one: stop the other"
        found = find_second_publisher(node, ("quiet", topic))
        assert found.startswith(expected)
        assert ("-r /clock:=clock" in found) == (topic == "/clock")
        other.destroy_publisher(publisher)
        graph.wait(lambda topic=topic: not find_second_publisher(node, (topic,)), "its end")


@pytest.mark.parametrize("what", ["FIFO", "link"])
def test_what_is_no_regular_file_is_named(node, what, tmp_path, monkeypatch):
    monkeypatch.setattr(ownership, "private_folder", lambda: tmp_path)
    path = tmp_path / lock_name(node.context.get_domain_id(), "/sain")
    os.mkfifo(path) if what == "FIFO" else path.symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match=rf"cannot lock {path}: "):
        lock_namespace(node)
    assert not (tmp_path / "victim").exists()
