"""What the simulator's node does where something fails that never should, or too much is sent."""

import re

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.node import Node

from sain_core.errors import ErrorCode
from sain_core.ros.qos import QUEUE
from sain_interfaces.msg import Bodies, Push, PushResult, Scene
from sain_sim.ros.sim_node import SimNode

AHEAD = (0.0, 0.0, 0.1)


@pytest.fixture
def simulator(graph):
    node = graph.start(SimNode, idle_rate=20.0)
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    return node


def test_a_push_that_fails_unexpectedly_is_answered_and_the_next_one_is_executed(
    graph, simulator, monkeypatch
):
    def fail(*_):
        raise ZeroDivisionError("in the world")

    scene = graph.find("scene", settled=True)[-1]
    with monkeypatch.context() as patched:
        patched.setattr(simulator.simulator, "push", fail)
        graph.push(scene, 1, AHEAD)
        result = graph.result(1)
    assert ErrorCode(result.error_code) is ErrorCode.INTERNAL
    assert result.error_message == "ZeroDivisionError: in the world"
    assert result.after.scene_id == scene.scene_id + 1  # bodies may have moved
    graph.push(result.after, 2, AHEAD)
    assert graph.result(2).error_code == ErrorCode.OK
    assert simulator.driver.reception.figures["defects"] == 1


def test_a_push_that_is_too_large_is_answered_without_what_is_too_large(graph, simulator):
    graph.wait(lambda: graph.pushing.get_subscription_count() == 2, "who takes a push")
    graph.pushing.publish(Push(push_id=5, source="x" * 2**20, length=0.1))
    result = graph.result(5)
    assert ErrorCode(result.error_code) is ErrorCode.INVALID
    assert re.fullmatch(
        r"the message has \d{7} bytes; at most 1048576 are accepted", result.error_message
    )
    assert result.push == Push(push_id=5, length=0.1)


def test_each_push_of_a_burst_is_answered(graph, simulator):
    sender = graph.bystander.create_publisher(Push, "push", QUEUE)
    results: list[int] = []
    graph.bystander.create_subscription(
        PushResult, "push_result", lambda result: results.append(result.push_id), QUEUE
    )
    graph.wait(lambda: sender.get_subscription_count() == 2, "who takes a push")
    for push_id in range(1, 301):
        sender.publish(Push(push_id=push_id, episode_id=99))
    graph.wait(lambda: len(results) == 300, "all results")
    assert sorted(results) == list(range(1, 301))


@pytest.mark.parametrize("topic", ["scene", "shapes"])
def test_a_second_publisher_is_an_error_on_diagnostics_until_it_ends(
    graph, ros_domain, simulator, topic
):
    graph.listen("/diagnostics", DiagnosticArray)
    elsewhere = Context()
    rclpy.init(context=elsewhere, domain_id=ros_domain)
    second = Node("second", namespace="sain", context=elsewhere)
    second.create_publisher({"scene": Scene, "shapes": Bodies}[topic], topic, 1)
    expected = f"/sain/second and /sain/sim_node publish /sain/{topic}; there must be one"

    def status():
        return graph.heard["/diagnostics"][-1].status[0] if graph.heard["/diagnostics"] else None

    graph.wait(lambda: status() and status().message.startswith(expected), "the error")
    assert status().level == DiagnosticStatus.ERROR
    second.destroy_node()
    elsewhere.try_shutdown()
    graph.wait(lambda: status().level == DiagnosticStatus.OK, "the end of the second")
