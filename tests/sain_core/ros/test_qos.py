"""Simulated time: what no clock shows changes nothing, and ends no node."""

import pytest
from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from sain_core.ros.qos import SIMULATED, LatchedTopic


@pytest.mark.parametrize("wrong", [(-1, 0), (-(2**31), 5), (7, 10**9), (2**31 - 1, 2**32 - 1)])
def test_a_time_that_cannot_be_is_ignored(graph, wrong):
    node = graph.add(Node("mine", context=graph.context, parameter_overrides=[SIMULATED]))
    clock = graph.bystander.create_publisher(Clock, "/clock", 1)
    graph.wait(clock.get_subscription_count, "who hears the clock")

    def show(sec, nanosec=0):
        clock.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))

    def now():
        return node.get_clock().now().nanoseconds

    show(5)
    graph.wait(lambda: now() == 5 * 10**9, "the time")
    show(*wrong)
    show(*wrong)
    for _ in range(10):
        graph.executor.spin_once(timeout_sec=0.05)
    assert now() == 5 * 10**9
    show(6)
    graph.wait(lambda: now() == 6 * 10**9, "the next time")


pytestmark = pytest.mark.ros


def test_a_late_listener_with_best_effort_hears_the_last_message_once(graph) -> None:
    speaker = graph.add(Node("speaker", namespace="sain", context=graph.context))
    topic = LatchedTopic(speaker, String, "said")
    graph.listen("said", String)
    graph.wait(lambda: speaker.count_subscribers("said") == 1, "the early listener")
    topic.publish(String(data="shapes"))
    graph.wait(lambda: graph.heard["said"], "what is said")
    late: list[str] = []
    listener = graph.add(Node("late", namespace="sain", context=graph.context))
    listener.create_subscription(
        String, "said", lambda message: late.append(message.data), qos_profile_sensor_data
    )
    graph.wait(lambda: late, "what was said before")
    looks: list[int] = []
    speaker.create_timer(0.5, lambda: looks.append(1))
    graph.wait(lambda: len(looks) == 3, "three more looks")
    assert late == ["shapes"]
    assert [message.data for message in graph.heard["said"]] == ["shapes", "shapes"]
