"""The driver of an arm over DDS, against the trajectory server: its side of the contract."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

from sain_arm.ros.arm_node import ArmNode
from sain_arm.ros.trajectory_server import TrajectoryServer
from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_mppi.agent.goal_tracker import LOOK_AGAIN
from sain_vision.ros.scene_node import SceneNode

BODIES = str(Path(__file__).with_name("bodies.yaml"))
PLACE = (0.5, 0.0, 0.0, 0.5, 0.25, 0.0)


class Laboratory:
    """The nodes of a robot, without planner and model, and an enable signal."""

    def __init__(self, graph: Any, arm: dict[str, Any], server: dict[str, Any]) -> None:
        self.graph = graph
        for topic, kind in (
            ("/joint_states", JointState),
            ("/diagnostics", DiagnosticArray),
            ("poses", PoseArray),
        ):
            graph.listen(topic, kind)
        for topic, kind in (("reach_table", OccupancyGrid), ("ghost", MarkerArray)):
            graph.bystander.create_subscription(kind, topic, graph.heard[topic].append, LATCHED)
        self.enabled = False
        publisher = graph.bystander.create_publisher(Bool, "enable", RELIABLE)
        graph.bystander.create_timer(0.05, lambda: self._beat(publisher))
        server = {"pace": 2.0, "place": PLACE} | server
        self.server = graph.start(TrajectoryServer, robot="ur5", bodies=BODIES, **server)
        self.arm = graph.start(ArmNode, robot="ur5", **arm)
        graph.start(SceneNode, bodies=BODIES, max_speed=1.5)
        graph.wait(lambda: graph.heard["reach_table"], "the table of reach")
        graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
        self.ids = iter(range(1, 1000))

    def _beat(self, publisher: Any) -> None:
        if self.enabled:
            publisher.publish(Bool(data=True))

    @property
    def scene(self) -> Any:
        return self.graph.find("scene", settled=True)[-1]

    def push(self, push: Any = (0.0, 0.0, 0.06), **ids: int) -> Any:
        push_id = next(self.ids)
        self.graph.push(self.scene, push_id, push, **ids)
        return push_id

    def execute(self, push: Any = (0.0, 0.0, 0.06)) -> Any:
        """Push as a planner does: anew while the refusal says so."""
        while (result := self.graph.result(self.push(push))).error_code in LOOK_AGAIN:
            seen = len(self.graph.heard["scene"])
            self.graph.wait(lambda n=seen: len(self.graph.heard["scene"]) > n + 3, "other scenes")
        return result

    def settle(self, scene_id: int) -> None:
        self.graph.wait(lambda: self.scene.scene_id >= scene_id, f"scene {scene_id}")

    def joints(self) -> np.ndarray:
        return np.array(self.graph.heard["/joint_states"][-1].position)


@pytest.fixture
def make(graph: Any) -> Any:
    def make(arm: dict[str, Any] | None = None, **server: Any) -> Laboratory:
        return Laboratory(graph, arm or {}, server)

    return make


def moved(result: Any) -> np.ndarray:
    before, _, after = wire.decode_result(result)
    return np.hypot(*(after - before)[:, :2].T)


def test_pushes_are_made_and_answered(graph: Any, make: Any) -> None:
    lab = make()
    lab.enabled = True
    first = lab.scene.scene_id
    for number, push in enumerate([(0.0, 0.0, 0.06), (2.0, 0.3, 0.05)]):
        result = lab.execute(push)
        assert result.error_code == ErrorCode.OK, result.error_message
        assert (result.before.scene_id, result.after.scene_id) == (
            first + number,
            first + number + 1,
        )
        assert 0.02 < moved(result)[0] < 0.08
        assert moved(result)[1] < 0.002
        lab.settle(first + number + 1)
    report = lab.server.cell.report
    assert (report.limits, report.contacts) == ({}, {})
    assert report.tool > 0
