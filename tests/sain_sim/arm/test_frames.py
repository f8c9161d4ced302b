"""The arm's description, and where its links are: against Bullet, which reads the same URDF."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sain_sim.arm.client import Client
from sain_sim.arm.kinematics import LOWER_LIMITS, UPPER_LIMITS, Kinematics
from sain_sim.arm.panda import BASE_FRAME, JOINT_NAMES, TOOL_FRAME, describe_arm, links_of

RADIUS, LENGTH = 0.012, 0.22


@pytest.fixture(scope="module")
def description():
    return describe_arm(RADIUS, LENGTH)


def pose_of(description, joints):
    """The frames behind the joints, as a tf2 listener composes them."""
    angles, poses = iter(joints), {BASE_FRAME: (np.zeros(3), Rotation.identity())}
    for link in links_of(description):
        place, turn = poses[link.parent]
        own = Rotation.from_quat(link.turned(next(angles) if link.moves else 0.0))
        poses[link.child] = place + turn.apply(link.origin), turn * own
    return poses


def test_links_are_where_bullet_has_them(description, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(description.replace("file://", ""))
    client = Client()
    body = client.loadURDF(str(path), useFixedBase=True)
    for joints in np.random.default_rng(0).uniform(LOWER_LIMITS, UPPER_LIMITS, (5, 7)):
        for joint, angle in enumerate(joints):
            client.resetJointState(body, joint, angle)
        poses = pose_of(description, joints)
        for joint in range(client.getNumJoints(body)):
            name = client.getJointInfo(body, joint)[12].decode()
            state = client.getLinkState(body, joint, computeForwardKinematics=True)
            place, turn = poses[name]
            np.testing.assert_allclose(place, state[4], atol=1e-6)
            away = (turn.inv() * Rotation.from_quat(state[5])).magnitude()
            assert away == pytest.approx(0.0, abs=1e-5)
    client.close()


def test_the_tool_is_where_the_planner_of_motions_has_it(description):
    joints = np.array([0.4, 0.3, 0.0, -2.0, 0.0, 2.3, np.pi / 4])
    place, turn = pose_of(description, joints)[TOOL_FRAME]
    np.testing.assert_allclose(place, Kinematics(0.0, LENGTH).tips(joints), atol=1e-9)
    np.testing.assert_allclose(turn.apply([0.0, 0.0, 1.0]), [0.0, 0.0, -1.0], atol=1e-9)


def test_each_joint_that_moves_has_a_state_and_all_links_hang_together(description):
    robot = ElementTree.fromstring(description)
    joints = robot.findall("joint")
    assert [j.get("name") for j in joints if j.get("type") != "fixed"] == list(JOINT_NAMES)
    behind = {link.child for link in links_of(description)}
    assert {link.get("name") for link in robot.findall("link")} == behind | {BASE_FRAME}


def test_a_viewer_finds_each_mesh(description):
    found = [mesh.get("filename") for mesh in ElementTree.fromstring(description).iter("mesh")]
    assert len(found) >= 10
    for name in found:
        assert name.startswith("file:///")
        assert Path(name.removeprefix("file://")).is_file()
