"""A planner that goes on where another process was left."""

import json

import pytest

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_interfaces.msg import Plan
from sain_model.physics.planar import PlanarPrior
from sain_mppi.ros.mppi_node import MppiNode
from tests.sain_mppi.ros.straw import GOAL, SMALL, START, nth_push, plan


@pytest.fixture
def path(tmp_path):
    return tmp_path / "planner.json"


def start(graph, path, **settings):
    settings |= {"dynamics": "in_process", "model": "planar", "state_file": str(path)}
    node = graph.start(MppiNode, **settings, **SMALL)
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    return node


def executed(graph, straw, number, scene_id):
    """Execute a push; return the scene after it."""
    push = nth_push(graph, number)
    before = wire.decode_disks(graph.heard["scene"][-1].disks)
    after = PlanarPrior().step(before[None], wire.decode_push(push)[None])[0]
    straw.answer(push, ErrorCode.OK, before=before, after=after)
    straw.show(scene_id=scene_id, disks=after)
    return after


def test_goal_pushes_and_history_go_on(graph, straw, path):
    node = start(graph, path)
    graph.aim(GOAL, 1, max_pushes=2)
    straw.show()
    executed(graph, straw, 1, scene_id=2)
    second = nth_push(graph, 2)
    first_plans = plan(graph, push_id=second.push_id).plan_id
    graph.wait(lambda: json.loads(path.read_text())["pushes"] == 2, "both pushes noted")
    graph.stop(node)
    node = start(graph, path)
    assert node.agent.pushes == 2
    assert len(node.agent._history[1]) == 1
    executed(graph, straw, 2, scene_id=3)
    made = plan(graph, goal_id=1, scene_id=3)
    assert made.status in (Plan.REACHED, Plan.EXHAUSTED)
    assert made.plan_id > first_plans
    assert len(graph.heard["push"]) == 2


def test_a_planner_that_dies_while_it_says_reached_says_it_again(graph, straw, path, monkeypatch):
    node = start(graph, path)
    noted = []
    publish = node.plans.publisher.publish

    def publish_and_die(message):
        publish(message)
        noted.append(json.loads(path.read_text())["goal"])
        monkeypatch.setattr(node.notes, "add_plan", lambda plan: None)

    monkeypatch.setattr(node.plans.publisher, "publish", publish_and_die)
    graph.aim(START[1, :2], 1)
    straw.show()
    assert plan(graph, goal_id=1).status == Plan.REACHED
    assert noted[0], "the goal was noted as over before anybody was told"
    graph.stop(node)
    start(graph, path)
    while len(graph.find("plan", goal_id=1)) < 2:
        straw.show()
        graph.spin(0.05)
    assert graph.find("plan", goal_id=1)[1].status == Plan.REACHED


def test_a_simulator_that_restarts_is_sent_another_push(graph, straw, path):
    """It tells the shapes again; nothing else may be heard of the push that was under way."""
    from sain_core.ros import codec
    from sain_core.ros.qos import LATCHED
    from sain_core.shapes.bodies import Bodies
    from sain_interfaces.msg import Bodies as BodiesMessage

    shapes = graph.bystander.create_publisher(BodiesMessage, "shapes", LATCHED)
    stamp = graph.bystander.get_clock().now().to_msg()
    message = codec.encode_bodies(Bodies.disks(2), START[:, 7].tolist(), stamp=stamp, episode_id=1)
    start(graph, path, answer_timeout=1.0)
    graph.wait(shapes.get_subscription_count, "who wants shapes")
    shapes.publish(message)
    graph.aim(GOAL, 1)
    straw.show()
    first = nth_push(graph, 1)
    shapes.publish(message)
    while len(graph.heard["push"]) < 2:  # as a simulator does, which says again and again what is
        straw.show()
        graph.spin(0.05)
    second = graph.heard["push"][1]
    assert second.push_id != first.push_id and second.scene_id == first.scene_id
    assert plan(graph, push_id=second.push_id).error_code == ErrorCode.OK
