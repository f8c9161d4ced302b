"""Of two nodes that claim a topic the later ends, and other publishers are reported."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from sain_core.errors import BusyError
from sain_core.ros.ownership import Ownership
from sain_interfaces.msg import Goal

CLAIM = """
import time, rclpy
from rclpy.node import Node
from sain_core.ros.node_main import ros_context
from sain_core.ros.ownership import Ownership
with ros_context():
    node = Node("killed", namespace="sain")
    Ownership(node, ("aim",))
    publisher = node.create_publisher({kind}, "aim", 1)
    print("claimed", flush=True)
    time.sleep(600)
""".replace("{kind}", "__import__('sain_interfaces.msg').msg.Goal")


@pytest.fixture
def other(ros_domain: int) -> Iterator[Node]:
    """A node that stands for another process."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = Node("other", namespace="sain", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def owner(graph, name: str) -> tuple[Node, Ownership]:
    node = graph.add(Node(name, namespace="sain", context=graph.context))
    return node, Ownership(node, ("aim",))


def test_the_later_of_two_ends_also_when_it_sees_the_first_late(graph):
    first, second = owner(graph, "first")[1], owner(graph, "second")[1]
    with pytest.raises(BusyError, match="/sain/first publishes /sain/aim already; stop it, or"):
        second.refuse(5.0)
    graph.wait(lambda: not first.rival(), "the end of the second's claim")
    third = owner(graph, "third")[1]
    first.refuse(0.5)
    assert first.rival().startswith("/sain/third publishes /sain/aim, too; stop it")
    with pytest.raises(BusyError, match="/sain/first publishes /sain/aim already"):
        third.rival()


def test_a_rival_that_ended_is_no_longer_reported(graph):
    first, (second, _) = owner(graph, "first")[1], owner(graph, "second")
    assert first.rival()
    graph.stop(second)
    graph.wait(lambda: not first.rival(), "the end of the rival")


def test_a_publisher_without_a_claim_is_refused_at_the_start_and_reported_later(graph, other):
    node, owned = owner(graph, "first")
    publisher = other.create_publisher(Goal, "aim", 1)
    graph.wait(lambda: node.count_publishers("aim") == 1, "the stranger")
    graph.wait(owned.rival, "its name")
    assert owned.rival().startswith("/sain/other publishes /sain/aim, too; stop it")
    owned.refuse(0.0, strangers=False)
    with pytest.raises(BusyError, match="/sain/other publishes /sain/aim already"):
        owned.refuse(5.0)
    other.destroy_publisher(publisher)


def test_another_clock_is_reported_with_the_remapping_that_helps(graph, other):
    node = graph.add(Node("first", namespace="sain", context=graph.context))
    owned = Ownership(node, ("/clock",))
    other.create_publisher(Clock, "/clock", 1)
    with pytest.raises(BusyError, match=r"/sain/other publishes /clock already.* -r /clock:=clock"):
        owned.refuse(5.0)


def test_the_claim_of_a_killed_process_does_not_count(graph):
    with subprocess.Popen([sys.executable, "-c", CLAIM], stdout=subprocess.PIPE, text=True) as one:
        assert one.stdout is not None
        assert one.stdout.readline() == "claimed\n"
        node, owned = owner(graph, "first")
        graph.wait(lambda: node.count_publishers("aim") == 1, "the publisher")
        with pytest.raises(BusyError, match="/sain/killed publishes /sain/aim already"):
            owned.refuse(5.0)
        owned = Ownership(node, ("aim",))
        one.send_signal(signal.SIGKILL)
        time.sleep(0.5)
        owned.refuse(0.2)  # nobody has waited for its end yet
    assert node.count_publishers("aim") == 1  # discovery has not noticed
    owned.refuse(0.2)
    assert not owned.rival()
