import pytest

from sain_mppi.ros.mppi_node import MppiNode
from tests.sain_mppi.ros.straw import SMALL, Straw


@pytest.fixture
def straw(graph):
    """A simulator of straw that the bystander of the graph hears."""
    straw = Straw(graph)
    graph.wait(lambda: straw.scenes.get_subscription_count() == 1, "the bystander")
    return straw


@pytest.fixture
def planner(graph, straw):
    """The node with its model in process, connected."""
    node = graph.start(MppiNode, dynamics="in_process", model="planar", **SMALL)
    graph.wait(lambda: straw.scenes.get_subscription_count() == 2, "the planner")
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    return node
