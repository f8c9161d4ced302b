"""What RViz reads of the arm and of the bodies: a description and a tree of frames."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import read_robot
from sain_arm.robot.urdf import TIP
from sain_core import wire
from sain_core.scene import DISK_HEIGHT, THETA
from sain_sim.ros.sim_node import SimNode
from tests.tf import Buffer

LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Viewer:
    """Joins when the simulator is there already, as RViz does; its fixed frames come last."""

    def __init__(self, graph, description):
        self.graph = graph
        self.buffer = Buffer()
        self.said, self.joints = [], []
        node = graph.bystander
        node.create_subscription(TFMessage, "/tf", self.buffer.receive, 100)
        timer = node.create_timer(0.5, lambda: timer.cancel() or self.join_static())
        node.create_subscription(String, description, self.said.append, LATE)
        node.create_subscription(JointState, "joint_states", self.joints.append, 100)
        graph.wait(lambda: self.said and self.frames, "the arm's description")

    def join_static(self):
        receive = self.buffer.receive
        self.graph.bystander.create_subscription(TFMessage, "/tf_static", receive, LATE)

    @property
    def frames(self):
        return set(self.buffer.latest)

    def pose(self, frame):
        """Wait for all frames up to this one, and return its pose (4, 4) in the world."""
        self.graph.wait(lambda: self.buffer.connects(frame), frame)
        return self.buffer.lookup(frame)

    def place(self, body):
        pose = self.pose(f"body_{body}")
        return [*pose[:3, 3], np.arctan2(pose[1, 0], pose[0, 0])]

    def sees(self, scene):
        """Whether bodies are where a scene has them."""
        rows = wire.decode_disks(scene.disks)
        if not all(f"body_{body}" in self.frames for body in range(len(rows))):
            return False
        expected = [[x, y, DISK_HEIGHT / 2, theta] for x, y, theta in rows[:, : THETA + 1]]
        seen = [self.place(body) for body in range(len(rows))]
        return bool(np.allclose(seen, expected, atol=1e-9))


@pytest.fixture
def simulator(graph):
    node = graph.start(SimNode, idle_rate=20.0)
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    return node


@pytest.fixture
def viewer(graph, simulator):
    return Viewer(graph, "robot_description")


def test_every_link_of_the_description_has_a_place_in_the_world(graph, viewer):
    robot = ElementTree.fromstring(viewer.said[0].data)
    for link in robot.findall("link"):
        assert viewer.pose(link.get("name")).shape == (4, 4)
    moving = [j.get("name") for j in robot.findall("joint") if j.get("type") != "fixed"]
    graph.wait(lambda: viewer.joints, "the joints")
    assert moving == list(viewer.joints[-1].name) == list(read_robot("paper_panda").joints)


def test_frames_follow_a_push_from_scene_to_scene(graph, viewer):
    scene = graph.find("scene", settled=True)[-1]
    graph.wait(lambda: viewer.sees(scene), "the bodies")
    graph.push(scene, 7, (0.2, -0.1, 0.12))
    after = graph.result(7).after
    graph.wait(lambda: viewer.sees(after), "the bodies after the push")
    arm = ArmModel(read_robot("paper_panda"))

    def agree():  # the arm may still be on its way home, and the topics come one after the other
        tip = arm.tip(np.array(viewer.joints[-1].position))
        return np.allclose(viewer.pose(TIP)[:3, 3], tip, atol=1e-6)

    graph.wait(agree, "a tool where the joints have it")
    assert not viewer.buffer.problems


@pytest.mark.parametrize(("given", "prefix"), [("", "lab/"), ("left_", "left_")])
def test_frames_of_another_graph_have_a_prefix(graph, given, prefix):
    def node(**options):
        return SimNode(cli_args=["--ros-args", "-r", "__ns:=/lab"], **options)

    graph.start(node, idle_rate=20.0, frame_prefix=given)
    viewer = Viewer(graph, "/lab/robot_description")
    graph.wait(lambda: f"{prefix}body_0" in viewer.frames, "bodies")
    assert {name[: len(prefix)] for name in viewer.frames} == {prefix}
    assert np.isfinite(viewer.pose(prefix + TIP)).all()
