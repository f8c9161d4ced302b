"""A policy in the planner's node that has no pushes: nothing moves, and messages say why."""

from diagnostic_msgs.msg import DiagnosticArray

from sain_core.errors import ErrorCode
from sain_interfaces.msg import Plan
from sain_mppi.ros.mppi_node import MppiNode
from tests.sain_mppi.ros.straw import GOAL, plan


def test_a_policy_without_pushes_ends_the_goal_and_the_graph_goes_on(graph, straw):
    graph.listen("/diagnostics", DiagnosticArray)
    graph.start(MppiNode, policy="tests.policies:blank")
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    straw.show()
    for goal in (1, 2):
        graph.aim(GOAL, goal)
        made = plan(graph, goal_id=goal)
        assert made.status == Plan.NO_PUSH
        assert ErrorCode(made.error_code) is ErrorCode.NO_PUSH
        assert made.error_message == (
            "10 answers in a row were refused, the last: policy tests.policies:blank:"
            " body of the action is nan; must be finite"
        )
    assert not graph.heard["push"]

    def counted():
        return [
            status
            for message in graph.heard["/diagnostics"]
            for status in message.status
            if "in a row were refused" in status.message
            and any((one.key, one.value) == ("policy_refused", "20") for one in status.values)
        ]

    graph.wait(counted, "the count on /diagnostics")
