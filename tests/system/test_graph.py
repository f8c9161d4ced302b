"""Simulator, model and planner together, from a reset to the goal."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.scene import POSITION, TARGET, make_scene
from sain_interfaces.msg import Plan
from sain_model.ros.model_node import ModelNode
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.ros.sim_node import SimNode

SMALL = {"planner__samples": 128, "planner__rounds": 2, "planner__horizon": 3}
START = make_scene(
    np.array([(0.42, 0.02), (0.561, 0.02)]), np.array([7.5, 8.3]), np.array([0.08, 0.06])
)


def ended(graph, goal_id):
    return [plan for plan in graph.find("plan", goal_id=goal_id) if plan.status != Plan.PUSH]


@pytest.fixture
def running(graph):
    graph.start(SimNode)
    graph.start(ModelNode, model="planar")
    planner = graph.start(MppiNode, **SMALL)
    graph.wait(planner.remote._client.service_is_ready, "the model's service")
    graph.wait(lambda: graph.pushing.get_subscription_count() == 2, "the simulator")
    return planner


def play(graph, goal, goal_id, **goal_fields):
    scene = graph.reset(disks=codec.encode_disks(START), friction=0.15, seed=1)
    graph.aim(goal, goal_id, episode_id=scene.episode_id, **goal_fields)
    graph.wait(lambda: ended(graph, goal_id), "the end of the episode")
    return ended(graph, goal_id)[0]


def test_the_target_is_brought_to_its_goal(graph, running):
    goal = np.array([0.70, 0.06])
    end = play(graph, goal, 1, tolerance=0.02, max_pushes=15)
    assert end.status == Plan.REACHED
    results = graph.heard["push_result"]
    assert results
    assert all(result.error_code == ErrorCode.OK for result in results)
    last = wire.decode_disks(results[-1].after.disks)
    left = np.hypot(*(last[TARGET, POSITION] - goal))
    assert left <= 0.02 and end.goal_distance == pytest.approx(left)


def test_a_second_planner_is_an_error_on_diagnostics(graph, running):
    graph.listen("/diagnostics", DiagnosticArray)
    arguments = ["--ros-args", "-r", "__node:=second"]
    graph.add(MppiNode(context=graph.context, cli_args=arguments))

    def errors() -> str:
        status = [one for array in graph.heard["/diagnostics"] for one in array.status]
        return " ".join(one.message for one in status if one.level == DiagnosticStatus.ERROR)

    expected = "/sain/mppi_node and /sain/second publish /sain/plan; there must be one"
    graph.wait(lambda: expected in errors(), "the error")
