"""Simulator, model and planner together: bodies that are no disks, to poses."""

import numpy as np
import pytest
from visualization_msgs.msg import MarkerArray

from sain_core import wire
from sain_core.goal import BodyPose
from sain_core.goal import Goal as CoreGoal
from sain_core.ros import codec
from sain_core.scene import make_scene
from sain_interfaces.msg import Plan
from sain_model.ros.model_node import ModelNode
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.ros.sim_node import SimNode

SMALL = {
    "planner__samples": 256,
    "planner__rounds": 3,
    "planner__horizon": 3,
    "model_timeout": 60.0,  # kernels may have to be compiled
}
NAMES, ROLES = ["t", "disk", "l"], ["pushable", "fixed", "pushable"]
START = make_scene(
    np.array([(0.46, 0.0), (0.62, 0.24), (0.40, -0.26)]),
    np.full(3, 8.0),
    np.array([0.09, 0.05, 0.07]),
    np.array([0.4, 0.0, -1.0]),
)


@pytest.fixture
def running(graph):
    graph.listen("markers", MarkerArray)
    graph.start(SimNode)
    graph.start(ModelNode, model="planar")
    planner = graph.start(MppiNode, **SMALL)
    graph.wait(planner.remote._client.service_is_ready, "the model's service")
    graph.wait(lambda: graph.pushing.get_subscription_count() == 2, "the simulator")
    return planner


def begin(graph):
    return graph.reset(
        disks=codec.encode_disks(START), shapes=NAMES, roles=ROLES, friction=0.15, seed=1
    )


def ended(graph, goal_id):
    return [plan for plan in graph.find("plan", goal_id=goal_id) if plan.status != Plan.PUSH]


def test_a_t_is_brought_into_its_pose_and_the_fixed_disk_stays(graph, running):
    scene = begin(graph)
    goal = CoreGoal((BodyPose(0, 0.50, 0.03, 0.9, 0.03, 0.2),), keep=(2,))
    graph.aim_at(goal, 1, episode_id=scene.episode_id, max_pushes=25)
    graph.wait(lambda: ended(graph, 1), "the end of the episode")
    (end,) = ended(graph, 1)
    assert (end.status, end.error_message) == (Plan.REACHED, "")
    assert end.goal_distance <= 0.03
    assert end.goal_turn <= 0.2
    results = graph.heard["push_result"]
    assert results
    assert {result.push.body for result in results} <= {0, 2}
    last = wire.decode_disks(results[-1].after.disks)
    assert np.hypot(*(last[0, :2] - (0.50, 0.03))) == pytest.approx(end.goal_distance)
    np.testing.assert_array_equal(last[1], START[1])
    assert np.hypot(*(last[2] - START[2])[:2]) <= 0.005
    plans = graph.find("plan", status=Plan.PUSH)
    assert not any(plan.fallback for plan in plans)
    assert {plan.dynamics for plan in plans} == {"planar"}
