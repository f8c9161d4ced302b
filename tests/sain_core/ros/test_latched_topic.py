"""Who joins late hears a latched topic, whatever durability he asks for."""

import pytest
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import String

from sain_core.ros.qos import LatchedTopic

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
