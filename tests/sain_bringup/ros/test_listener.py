"""What a person reads where a graph does nothing: nodes on DDS, and a listener among them."""

import os
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from sain_bringup.ros.listener import PLANNER, GraphListener
from sain_core.guarding.ros.ownership import lock_namespace
from sain_core.ros.node_main import OK, WARN, Diagnostics
from sain_core.ros.qos import RELIABLE
from sain_interfaces.msg import Plan, Scene

pytestmark = pytest.mark.ros

SILENT_ARM = "not enabled: the arm does not move"


@pytest.fixture
def lines():
    return []


@pytest.fixture
def listener(graph, lines):
    return GraphListener(
        graph.add(Node("goal", namespace="sain", context=graph.context)), lines.append
    )


def wait_for(graph, lines, words):
    graph.wait(lambda: any(words in line for line in lines), f"{words!r} in {lines}")


def run(graph, seconds):
    end = time.monotonic() + seconds
    graph.wait(lambda: time.monotonic() > end, "time to pass")


def test_a_warning_is_printed_once_and_again_when_it_comes_back(graph, listener, lines):
    arm = graph.add(Node("arm_node", namespace="sain", context=graph.context))
    diagnostics = Diagnostics(arm, "arm", period_s=0.2)
    diagnostics.set(WARN, SILENT_ARM)
    wait_for(graph, lines, SILENT_ARM)
    run(graph, 1.0)
    line = f"arm_node: {SILENT_ARM}; start in another terminal: ros2 run sain_arm enable"
    assert lines.count(line) == 1
    diagnostics.set(OK, "rests")
    run(graph, 1.0)
    diagnostics.set(WARN, SILENT_ARM)
    graph.wait(lambda: lines.count(line) == 2, "the line again")


def test_warnings_of_another_graph_are_not_printed_but_those_of_drivers_are(graph, listener, lines):
    publisher = graph.bystander.create_publisher(DiagnosticArray, "/diagnostics", RELIABLE)
    for name, hardware in (("/lab/arm_node: arm", "sain"), ("/camera: driver", "D435")):
        status = DiagnosticStatus(level=WARN, name=name, message="hot", hardware_id=hardware)
        graph.wait(lambda: publisher.get_subscription_count() > 0, "the listener")
        publisher.publish(DiagnosticArray(status=[status]))
    wait_for(graph, lines, "hot")
    assert [line for line in lines if "hot" in line] == ["/camera: hot; look at the log of /camera"]


def test_without_a_planner_it_says_where_it_looked(graph, listener, lines):
    wait_for(graph, lines, "no planner in namespace /sain: start ros2 run sain_mppi mppi_node")
    domain = os.environ["ROS_DOMAIN_ID"]
    assert any(line.endswith(f"ROS_DOMAIN_ID is {domain} here") for line in lines)
    wait_for(
        graph, lines, "no source of scenes in namespace /sain: start ros2 run sain_sim sim_node"
    )


def test_a_planner_in_another_namespace_is_named(graph, listener, lines):
    other = graph.add(Node("mppi_node", namespace="lab", context=graph.context))
    other.create_publisher(Plan, "plan", RELIABLE)
    wait_for(
        graph, lines, "no planner in namespace /sain, but one in /lab: add --ros-args -r __ns:=/lab"
    )


def test_a_planner_in_another_domain_is_named(graph, listener, monkeypatch):
    node = graph.bystander
    here = node.context.get_domain_id()
    with monkeypatch.context() as patched:
        patched.setattr(node.context, "get_domain_id", lambda: here + 1)
        release = lock_namespace(node)
    try:
        line = listener.absence(PLANNER)
    finally:
        release()
    assert (
        f"of domain {here}, but a graph in domain {here + 1}: export ROS_DOMAIN_ID={here + 1}"
        in line
    )
    assert "export" not in listener.absence(PLANNER)


def test_scenes_that_stop_are_missed_and_their_node_is_named(graph, listener, lines):
    node = graph.add(Node("scene_node", namespace="sain", context=graph.context))
    scenes = node.create_publisher(Scene, "scene", RELIABLE)
    timer = node.create_timer(0.1, lambda: scenes.publish(Scene()))
    run(graph, 4.0)
    silent = "no scene on /sain/scene for 3 s: /sain/scene_node should publish it"
    assert not any(silent in line for line in lines)
    timer.cancel()
    wait_for(graph, lines, silent)
