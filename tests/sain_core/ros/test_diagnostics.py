"""How a node is doing, as rqt_robot_monitor and diagnostic_aggregator read it."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from sain_core.ros.node_main import OK, WARN, Diagnostics, node_of


def test_a_status_is_named_after_node_and_task(graph):
    graph.listen("/diagnostics", DiagnosticArray)
    graph.wait(lambda: graph.bystander.count_subscribers("/diagnostics"), "who listens")
    node = graph.add(Node("worker", namespace="lab", context=graph.context))
    diagnostics = Diagnostics(node, "lifting", period_s=0.05)
    graph.wait(lambda: graph.heard["/diagnostics"], "the first status")
    (status,) = graph.heard["/diagnostics"][0].status
    assert (status.name, status.level, status.message) == ("/lab/worker: lifting", OK, "starting")
    diagnostics.set(WARN, "heavy", kilograms=3)

    def last():
        return graph.heard["/diagnostics"][-1].status[0]

    graph.wait(lambda: last().level == WARN, "the warning")
    assert [(pair.key, pair.value) for pair in last().values] == [("kilograms", "3")]


@pytest.mark.parametrize("name", ["/sain/mppi_node", "/sain/mppi_node: planning"])
def test_the_node_of_a_status_is_found_in_recordings_old_and_new(name):
    assert node_of(DiagnosticStatus(name=name)) == "/sain/mppi_node"
