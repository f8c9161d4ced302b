"""Markers as viewers show them."""

import pytest
from geometry_msgs.msg import Vector3
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.ros.markers import MarkerBoard, make_marker
from tests.rviz import shown


def cubes(count):
    made = [make_marker("cubes", number, Marker.CUBE, "#ffffff") for number in range(count)]
    for marker in made:
        marker.header.frame_id = "world"
        marker.scale = Vector3(x=0.1, y=0.1, z=0.1)
    return made


@pytest.fixture
def board(graph):
    graph.listen("boxes", MarkerArray)
    board = MarkerBoard(graph.bystander, "boxes")
    graph.wait(board._publisher.get_subscription_count, "the viewer")
    return board


def arrays(graph, count):
    graph.wait(lambda: len(graph.heard["boxes"]) >= count, f"{count} arrays")
    return graph.heard["boxes"]


def test_a_new_viewer_loses_the_markers_of_a_former_node(graph, board):
    board.show(cubes(1))
    arrays(graph, 1)
    late = []
    graph.bystander.create_subscription(MarkerArray, "boxes", late.append, 10)
    graph.wait(lambda: board._publisher.get_subscription_count() == 2, "the new viewer")
    board.show(cubes(1))
    graph.wait(lambda: late, "an array")
    rviz = shown([MarkerArray(markers=cubes(5))])
    rviz.receive(late[0])
    assert rviz.count() == {"cubes": 1}
    board.show(cubes(1))
    graph.wait(lambda: len(late) == 2, "another array")
    assert [marker.action for marker in late[1].markers] == [Marker.ADD]
