"""What the planner's node does where something fails that never should."""

import pytest

from sain_core.errors import ErrorCode
from sain_interfaces.msg import Plan
from sain_mppi.ros.mppi_node import MppiNode
from tests.sain_mppi.ros.straw import GOAL, SMALL, nth_push, plan


def fail(*_):
    raise ZeroDivisionError("in the planner")


@pytest.mark.parametrize("method", ["decide", "next"])
def test_planning_that_fails_unexpectedly_is_a_plan_without_a_push(
    graph, straw, monkeypatch, method
):
    node = graph.start(MppiNode, **SMALL)
    with monkeypatch.context() as patched:
        if method == "decide":
            patched.setattr(node.agent.decider, "decide", fail)
        straw.show()
        graph.wait(lambda: node.reception.figures["received_scene"], "the scene")
        if method == "next":
            node.agent._tracker.next_scene = fail
        graph.aim(GOAL, 1)
        found = plan(graph, goal_id=1)
        assert found.status == Plan.NO_PUSH
        assert ErrorCode(found.error_code) is ErrorCode.INTERNAL
        assert found.error_message == "ZeroDivisionError: in the planner"
    node.agent._tracker.__dict__.pop("next_scene", None)
    graph.aim(GOAL, 2)
    assert nth_push(graph, 1).scene_id == 1
    assert node.reception.figures["defects"] >= 1
