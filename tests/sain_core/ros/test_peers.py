"""Who else publishes what one node should own."""

import pytest
from rclpy.node import Node

from sain_core.errors import BusyError
from sain_core.guarding.ros.ownership import refuse_peers, refuse_rivals
from sain_core.ros.qos import LATCHED
from sain_interfaces.msg import Goal


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
