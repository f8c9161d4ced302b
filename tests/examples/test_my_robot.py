"""The robot of `examples/my_robot` in place of the simulator: the graph without `sim_node`."""

import json
import re
import signal
import subprocess
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray

from sain_bringup.graph import executable
from sain_core import wire
from sain_core.errors import ErrorCode
from sain_interfaces.msg import Plan
from sain_model.ros.model_node import ModelNode
from sain_mppi.ros.mppi_node import MppiNode
from sain_vision.ros.scene_node import SceneNode
from tests.examples.installing import install, run
from tests.paths import ROOT

EXAMPLE = ROOT / "examples" / "my_robot"
BODIES = EXAMPLE / "my_robot" / "bodies.yaml"
NOISE = "0.0005,0.005"
SMALL = {"planner__samples": 128, "planner__rounds": 2, "planner__horizon": 3}


@pytest.fixture
def robot_class(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    from my_robot.robot_node import RobotNode

    return RobotNode


@pytest.fixture
def robot(graph, robot_class):
    """A robot with its converter, and a settled scene."""
    graph.listen("true_poses", PoseArray)
    graph.listen("/diagnostics", DiagnosticArray)
    node = graph.start(robot_class, pace=2.0, noise=NOISE)
    graph.start(SceneNode, bodies=str(BODIES), noise=NOISE, max_speed=0.6)
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    return node


def latest(graph: Any) -> Any:
    return graph.find("scene", settled=True)[-1]


def ended(graph: Any, goal_id: int) -> list[Any]:
    return [plan for plan in graph.find("plan", goal_id=goal_id) if plan.status != Plan.PUSH]


def true_place(graph: Any, body: int) -> np.ndarray:
    pose = graph.heard["true_poses"][-1].poses[body].position
    return np.array([pose.x, pose.y])


def test_a_goal_is_reached(graph, robot):
    graph.start(ModelNode, model="planar")
    graph.start(MppiNode, estimator__noise=NOISE, **SMALL)
    goal = np.array([0.62, -0.08])
    graph.aim(goal, 1, tolerance=0.02, max_pushes=15)
    graph.wait(lambda: ended(graph, 1), "the end")
    assert ended(graph, 1)[0].status == Plan.REACHED
    assert np.linalg.norm(true_place(graph, 1) - goal) <= 0.02
    # Planner and robot share this thread: a push may come too late for its scene, and is sent anew.
    codes = {result.error_code for result in graph.heard["push_result"]}
    assert codes <= {ErrorCode.OK, ErrorCode.STALE_SCENE}
    results = [r for r in graph.heard["push_result"] if r.error_code == ErrorCode.OK]
    scenes = [(r.before.scene_id, r.after.scene_id) for r in results]
    first = scenes[0][0]
    assert scenes == [(first + n, first + n + 1) for n in range(len(scenes))]
    for result in results:
        before, _, after = wire.decode_result(result)
        assert np.abs(after - before).max() > 0.005


def test_a_push_is_refused_with_the_code_of_its_reason(graph, robot):
    scene = latest(graph)
    for push_id, push, ids, code in (
        (1, (0.0, 0.0, 0.9), {}, ErrorCode.OUT_OF_RANGE),
        (2, (0.0, 0.0, 0.1), {"scene_id": 99}, ErrorCode.STALE_SCENE),
        (3, (0.0, 0.0, 0.1), {"episode_id": 99}, ErrorCode.UNKNOWN_EPISODE),
        (0, (0.0, 0.0, 0.1), {}, ErrorCode.INVALID),
        (1, (0.0, 0.0, 0.1), {}, ErrorCode.DUPLICATE_PUSH),
    ):
        heard = len(graph.heard["push_result"])
        graph.push(scene, push_id, push, **ids)
        graph.wait(lambda n=heard: len(graph.heard["push_result"]) > n, "the refusal")
        result = graph.heard["push_result"][-1]
        assert (result.push_id, result.error_code) == (push_id, code), result.error_message
        assert result.error_message
    graph.push(scene, 7, (0.0, 0.0, 0.1))
    graph.push(scene, 8, (0.0, 0.0, 0.1))
    assert graph.result(8).error_code == ErrorCode.BUSY
    assert graph.result(7).error_code == ErrorCode.OK


def test_bodies_that_somebody_sets_up_anew_begin_an_episode(graph, robot):
    before = latest(graph)
    message = graph.heard["true_poses"][-1]
    message.poses[0].position.y += 0.4
    setting = graph.bystander.create_publisher(PoseArray, "set_up", 1)
    graph.wait(lambda: setting.get_subscription_count() > 0, "the robot")
    setting.publish(message)
    graph.wait(lambda: latest(graph).episode_id == before.episode_id + 1, "another episode")
    assert latest(graph).scene_id == before.scene_id + 1
    graph.wait(lambda: graph.find("shapes", episode_id=before.episode_id + 1), "its shapes")
    shapes = graph.heard["shapes"][-1]
    assert [body.role for body in shapes.bodies] == ["pushable", "movable"]
    told = [status.message for m in graph.heard["/diagnostics"] for status in m.status]
    jumped = r"body 0 \(puck\) jumped by 0\.[34]\d* m in 0\.\d+ s; at most 0\.6 m/s is taken"
    assert any(re.match(jumped, text) for text in told)


def test_two_foreign_robots_are_named_and_nothing_is_pushed(graph, robot):
    from sain_interfaces.msg import PushResult

    graph.bystander.create_publisher(PushResult, "push_result", 1)
    text = "/sain/bystander and /sain/robot_node publish /sain/push_result; there must be one"

    def told() -> bool:
        return any(text in s.message for m in graph.heard["/diagnostics"] for s in m.status)

    graph.wait(told, "the diagnostic")
    graph.wait(lambda: not graph.heard["scene"][-1].settled, "an unsettled scene")
    count = len(graph.find("scene", settled=True))
    graph.spin(1.0)
    assert len(graph.find("scene", settled=True)) == count


@pytest.mark.system
def test_the_whole_graph_runs_without_a_simulator(ros_domain, tmp_path):
    variables, site = install("my_robot", tmp_path), tmp_path / "site"
    robot, bodies = site / "bin" / "robot_node", site / "my_robot" / "bodies.yaml"
    graph = [str(executable("sain_bringup", "graph")), "--driver", str(robot), "--bodies"]
    graph += [str(bodies), "--noise", NOISE, "--model", "planar", "--bag", str(tmp_path / "bag")]
    with subprocess.Popen(graph, env=variables, stdout=subprocess.PIPE, text=True) as running:
        try:
            goal = [str(executable("sain_bringup", "goal")), "0.62", "-0.08", "--timeout", "60"]
            done = subprocess.run(goal, capture_output=True, text=True, timeout=200)
            assert done.returncode == 0, done.stderr + done.stdout
        finally:
            running.send_signal(signal.SIGINT)
            said = running.communicate(timeout=60)[0]
    assert running.returncode == 0, said
    for node in ("robot_node", "scene_node", "mppi_node", "model_node"):
        assert node in said
    assert "sim_node" not in said
    bag, data = tmp_path / "bag", tmp_path / "data"
    convert = [str(executable("sain_bags", "to_dataset"))]
    run(variables, convert, bag, "--out", data)
    assert json.loads((data / "card.json").read_text())["transitions"] > 0
