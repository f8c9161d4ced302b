"""The planner's node and bodies that are no disks: shapes come late, change, or cannot be."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from visualization_msgs.msg import Marker

from sain_core import wire
from sain_core.goal import BodyPose
from sain_core.goal import Goal as CoreGoal
from sain_core.ros import codec
from sain_core.ros.qos import LATCHED
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_model.physics.planar import PlanarPrior
from tests.rviz import shown
from tests.sain_mppi.ros.straw import nth_push, plan

SCENE = make_scene(
    np.array([(0.45, 0.0), (0.60, 0.25)]), np.full(2, 8.0), np.array([0.09, 0.05]), np.zeros(2)
)
TEE = Bodies.named(["t", "disk"], ["pushable", "fixed"])
TURN = CoreGoal((BodyPose(0, 0.50, 0.0, 0.3, 0.01, 0.05),))


@pytest.fixture
def shapes(graph):
    publisher = graph.bystander.create_publisher(BodiesMessage, "shapes", LATCHED)

    def send(bodies, episode_id=1):
        stamp = graph.bystander.get_clock().now().to_msg()
        radii = SCENE[: len(bodies), 7].tolist()
        publisher.publish(codec.encode_bodies(bodies, radii, stamp=stamp, episode_id=episode_id))

    send.publisher = publisher
    return send


@pytest.fixture(autouse=True)
def connected(graph, shapes, planner):
    graph.listen("/diagnostics", DiagnosticArray)
    graph.wait(lambda: shapes.publisher.get_subscription_count() == 2, "the planner")
    graph.wait(lambda: planner.count_publishers("shapes") == 1, "who sends shapes")


def warned(graph, text):
    def found():
        return [
            status.message
            for message in graph.heard["/diagnostics"]
            for status in message.status
            if text in status.message
        ]

    graph.wait(found, f"a diagnostic with {text!r}")


def test_a_scene_waits_for_the_shapes_of_its_episode(graph, straw, shapes, planner):
    graph.aim_at(TURN, 1)
    straw.show(disks=SCENE)
    graph.wait(lambda: planner.agent.early, "the scene to wait")
    assert not graph.heard["plan"]
    shapes(TEE)
    push = nth_push(graph, 1)
    made = plan(graph, push_id=push.push_id)
    assert (made.error_message, made.fallback, push.body) == ("", False, 0)
    pushes, predicted = wire.decode_plan(made)
    expected = PlanarPrior().with_bodies(TEE).step(SCENE[None], pushes[:1])[0]
    np.testing.assert_array_equal(predicted[0], expected)
    assert made.goal_distance == pytest.approx(0.05)
    assert made.goal_turn == pytest.approx(0.3)
    assert "turn" in made.cost_terms or "distance" in made.cost_terms


def test_plans_are_drawn_with_true_outlines(graph, straw, shapes, planner):
    shapes(TEE)
    graph.aim_at(TURN, 1)
    straw.show(disks=SCENE)
    nth_push(graph, 1)
    graph.wait(lambda: graph.heard["plan_markers"], "markers")
    markers = shown(graph.heard["plan_markers"]).visible
    goal, ghost = markers["goal", 0], markers["planned", 0]
    corners = np.array([(point.x, point.y) for point in goal.points])
    state = np.array([0.50, 0.0, 0.3, 0, 0, 0, 8.0, 0.09])
    np.testing.assert_allclose(corners[:-1], TEE.shapes[0].placed(state))
    assert (goal.type, ghost.type) == (Marker.LINE_STRIP, Marker.TRIANGLE_LIST)
    assert len(ghost.points) == 3 * len(TEE.shapes[0].triangles(0.09))
    assert ("planned", 1) not in markers
    assert len(markers["path", 0].points) == 3


def test_shapes_that_change_during_an_episode_are_ignored_and_reported(
    graph, straw, shapes, planner
):
    shapes(TEE)
    graph.aim_at(TURN, 1)
    straw.show(disks=SCENE)
    nth_push(graph, 1)
    shapes(Bodies.named(["l", "disk"], ["pushable", "fixed"]))
    warned(graph, "shapes of episode 1 are ignored: the shape of body 0 changed from t to l")
    assert planner.agent.bodies == TEE
