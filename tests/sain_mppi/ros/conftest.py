import pytest

from tests.sain_mppi.ros.straw import Straw


@pytest.fixture
def straw(graph):
    """A simulator of straw that the bystander of the graph hears."""
    straw = Straw(graph)
    graph.wait(lambda: straw.scenes.get_subscription_count() == 1, "the bystander")
    return straw
