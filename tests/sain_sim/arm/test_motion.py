"""The arm's description, and where its links are: against Bullet, which reads the same URDF."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sain_core.errors import ErrorCode, UnreachableError
from sain_core.feasibility import Reach
from sain_core.push import TOOL_RADIUS
from sain_sim.arm.client import Client
from sain_sim.arm.motion import (
    FLANGE_DROP,
    LOWER_LIMITS,
    TIME_STEP,
    TOOL_LENGTH,
    UPPER_LIMITS,
    stroke_tips,
    trapezoid,
)
from sain_sim.arm.panda import BASE_FRAME, JOINT_NAMES, PandaModel, describe_arm, links_of
from sain_sim.engines.bullet_cell import STICK_LINK
from sain_sim.world.workcell import WorldConfig

KINEMATICS = WorldConfig().kinematics
REACH = Reach()


@settings(max_examples=200, deadline=None)
@given(
    st.floats(REACH.inner, REACH.outer),
    st.floats(-REACH.max_bearing, REACH.max_bearing),
    st.floats(0.012, 0.092),
)
def test_joints_hold_the_tip_where_it_was_asked_for(radius, bearing, height):
    tip = np.array([radius * np.cos(bearing), radius * np.sin(bearing), height])
    joints = KINEMATICS.joints(tip)
    assert np.allclose(KINEMATICS.tips(joints), tip, atol=1e-12)
    assert (joints >= LOWER_LIMITS).all() and (joints <= UPPER_LIMITS).all()


def test_the_whole_described_reach_can_be_taken_low_and_raised():
    radius, bearing, height = np.meshgrid(
        np.linspace(REACH.inner, REACH.outer, 60),
        np.linspace(-REACH.max_bearing, REACH.max_bearing, 9),
        [MOTION.tip_height, MOTION.raised],
    )
    tips = np.stack([radius * np.cos(bearing), radius * np.sin(bearing), height], axis=-1)
    assert KINEMATICS.joints(tips).shape == (9, 60, 2, 7)


def test_bullet_puts_the_tip_where_the_formulas_do():
    client = Client()
    body = PandaModel(TOOL_RADIUS).load(client, KINEMATICS.base_height)
    tips = np.array([[0.5, 0.2, 0.012], [0.22, -0.1, 0.05], [0.0, 0.6, 0.092], [0.7, 0.1, 0.02]])
    for tip in tips:
        for joint, value in enumerate(KINEMATICS.joints(tip)):
            client.resetJointState(body, joint, value)
        state = client.getLinkState(body, STICK_LINK, computeForwardKinematics=True)
        turn = np.reshape(client.getMatrixFromQuaternion(state[5]), (3, 3))
        drop = FLANGE_DROP + TOOL_LENGTH
        assert np.allclose(turn[:, 2], [0, 0, -1], atol=1e-5)  # the tool is vertical
        assert np.allclose(state[4] + drop * turn[:, 2], tip, atol=1e-5)
    client.close()


@pytest.mark.parametrize(
    ("tip", "reason"),
    [
        ((0.9, 0.0, 0.012), "(0.900, 0.000, 0.012) m: it is out of the arm's reach"),
        ((0.09, 0.0, 0.012), "joint"),
        ((-0.5, 0.01, 0.012), "joint 1 would leave [-2.8973, 2.8973] rad"),
    ],
)
def test_a_pose_that_cannot_be_taken_is_named_with_its_reason(tip, reason):
    with pytest.raises(UnreachableError) as caught:
        KINEMATICS.joints(np.array([[0.5, 0.0, 0.05], tip]))
    assert reason in str(caught.value)
    assert caught.value.code is ErrorCode.UNREACHABLE


MOTION, SPEED = WorldConfig().motion, 0.2  # [m/s]


@given(st.floats(1e-6, 0.5))
def test_a_profile_goes_from_rest_to_rest_inside_its_limits(length):
    way = trapezoid(length, SPEED, MOTION.acceleration)
    assert way[0] == 0.0
    assert np.isclose(way[-1], length, rtol=1e-12)
    steps = np.diff(way)
    assert (steps >= -1e-15).all()
    assert steps.max() <= SPEED * TIME_STEP + 1e-12
    limit = MOTION.acceleration * TIME_STEP**2
    assert np.abs(np.diff(steps, prepend=0.0, append=0.0)).max() <= limit + 1e-12


def test_a_stroke_is_straight_and_low():
    tips = stroke_tips(MOTION, np.array([0.4, 0.1]), np.array([0.5, -0.02]), SPEED)
    assert np.allclose(tips[0], [0.4, 0.1, MOTION.tip_height])
    assert np.allclose(tips[-1], [0.5, -0.02, MOTION.tip_height])
    way = (tips[-1] - tips[0])[:2]
    offset = (tips - tips[0])[:, :2]
    assert np.allclose(way[0] * offset[:, 1], way[1] * offset[:, 0], atol=1e-12)


RADIUS = 0.012


@pytest.fixture(scope="module")
def description():
    return describe_arm(RADIUS)


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
