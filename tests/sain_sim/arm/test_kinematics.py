import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sain_core.errors import ErrorCode, UnreachableError
from sain_core.feasibility import Reach
from sain_core.push import TOOL_RADIUS
from sain_sim.arm.client import Client
from sain_sim.arm.kinematics import FLANGE_DROP, LOWER_LIMITS, UPPER_LIMITS, Kinematics
from sain_sim.arm.motion import MotionConfig
from sain_sim.arm.panda import ArmConfig, PandaModel
from sain_sim.engines.bullet.arm import STICK_LINK
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
    motion = MotionConfig()
    radius, bearing, height = np.meshgrid(
        np.linspace(REACH.inner, REACH.outer, 60),
        np.linspace(-REACH.max_bearing, REACH.max_bearing, 9),
        [motion.tip_height, motion.raised],
    )
    tips = np.stack([radius * np.cos(bearing), radius * np.sin(bearing), height], axis=-1)
    assert KINEMATICS.joints(tips).shape == (9, 60, 2, 7)


@settings(max_examples=200, deadline=None)
@given(
    st.floats(0.02, 0.95),
    st.floats(0.02, 0.95),
    st.floats(-np.pi, np.pi),
    st.floats(-np.pi, np.pi),
)
def test_an_arm_that_can_stand_at_both_ends_of_a_way_can_go_along_it(near, far, begin, end):
    """So a way that is left out needs its ends looked at only."""
    motion = MotionConfig()
    raised, also_raised = (
        np.array([radius * np.cos(bearing), radius * np.sin(bearing), motion.raised])
        for radius, bearing in ((near, begin), (far, end))
    )
    low = np.array([*raised[:2], motion.tip_height])
    for start, stop, way in (
        (raised, also_raised, motion.arc(raised, also_raised)),
        (raised, low, motion.line(raised, low)),
        (low, raised, motion.line(low, raised)),
    ):
        if can_take(np.stack([start, stop])):
            assert can_take(way)


def can_take(tips) -> bool:
    try:
        return KINEMATICS.joints(tips).size > 0
    except UnreachableError:
        return False


def test_bullet_puts_the_tip_where_the_formulas_do():
    config = ArmConfig()
    client = Client()
    body = PandaModel(TOOL_RADIUS, config).load(client, KINEMATICS.base_height)
    tips = np.array([[0.5, 0.2, 0.012], [0.22, -0.1, 0.05], [0.0, 0.6, 0.092], [0.7, 0.1, 0.02]])
    for tip in tips:
        for joint, value in enumerate(KINEMATICS.joints(tip)):
            client.resetJointState(body, joint, value)
        state = client.getLinkState(body, STICK_LINK, computeForwardKinematics=True)
        turn = np.reshape(client.getMatrixFromQuaternion(state[5]), (3, 3))
        drop = FLANGE_DROP + config.tool_length
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


def test_a_pose_of_nan_is_refused():
    with pytest.raises(UnreachableError):
        Kinematics(-0.2, 0.22).joints(np.array([np.nan, 0.0, 0.012]))
