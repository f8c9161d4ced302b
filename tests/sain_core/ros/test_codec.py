"""What is encoded comes back bit for bit, also through the wire format of the middleware."""

import numpy as np
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message, serialize_message

from sain_core import wire
from sain_core.goal import BodyPose, Goal
from sain_core.push import make_push
from sain_core.ros import codec
from sain_interfaces.msg import Plan

finite = st.floats(allow_nan=False, allow_infinity=False, width=64)


def through_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


@given(arrays(np.float64, st.tuples(st.integers(2, 5), st.just(8)), elements=finite))
def test_a_scene_comes_back_bit_for_bit(scene):
    stamp = codec.encode_time(3_000_000_007)
    message = codec.encode_scene(scene, stamp=stamp, episode_id=2, scene_id=2**63, settled=True)
    back = through_the_wire(message)
    assert wire.decode_disks(back.disks).tobytes() == scene.tobytes()
    assert (back.episode_id, back.scene_id, back.settled) == (2, 2**63, True)
    assert (back.header.stamp, back.header.frame_id) == (Time(sec=3, nanosec=7), "world")


@given(arrays(np.float64, 3, elements=finite), st.integers(0, 31), st.floats(1e-3, 2.0))
def test_a_push_comes_back_bit_for_bit(path, body, speed):
    push = make_push(*path, body=body, speed=speed)
    message = codec.encode_push(
        push, stamp=Time(), push_id=7, episode_id=8, scene_id=9, source="me"
    )
    back = through_the_wire(message)
    assert wire.decode_push(back).tobytes() == push.tobytes()
    assert (back.push_id, back.episode_id, back.scene_id, back.source) == (7, 8, 9, "me")


@given(arrays(np.float64, 3, elements=finite))
def test_a_goal_comes_back_bit_for_bit(pose):
    x, y, heading = pose.tolist()
    poses = BodyPose(0, x, y, heading, 0.03, 0.2), BodyPose(3, y, x)
    for goal in (Goal.place(x, y, 0.01), Goal(poses[1:]), Goal(poses, (1, 2), 0.01)):
        message = codec.encode_goal(goal, stamp=Time(), goal_id=1, episode_id=2, max_pushes=15)
        back = through_the_wire(message)
        assert wire.decode_goal(back) == goal
        assert (back.goal_id, back.episode_id, back.max_pushes) == (1, 2, 15)


def test_a_plan_comes_back_bit_for_bit():
    random = np.random.default_rng(0)
    pushes, predicted = (
        make_push(*random.normal(size=(3, 4)), body=[0, 2, 1, 0]),
        random.normal(size=(4, 3, 8)),
    )
    plan = Plan()
    codec.fill_plan(plan, pushes, predicted)
    back = wire.decode_plan(through_the_wire(plan))
    np.testing.assert_array_equal(back[0], pushes)
    np.testing.assert_array_equal(back[1], predicted)
