"""States of joints: a bad one is refused in one line, and nothing is known then."""

from time import monotonic

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState

from sain_arm.robot.robot import read_robot
from sain_arm.ros.joint_listener import JointListener
from sain_core.errors import BusyError, InvalidInputError

UR5 = read_robot("ur5")
NAMES, HOME = list(UR5.joints), UR5.home.tolist()


def state(names: list[str] = NAMES, values: list[float] = HOME, sec: int = 100) -> JointState:
    message = JointState(name=names, position=values)
    message.header.stamp = Time(sec=sec)
    return message


def changed(joint: int, value: float) -> list[float]:
    return [*HOME[:joint], value, *HOME[joint + 1 :]]


DEGREES = np.degrees(HOME).tolist()


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (state(values=changed(1, np.nan)), f"joint {NAMES[1]} is at nan rad; its limits are"),
        (state(values=changed(0, -np.inf)), f"joint {NAMES[0]} is at -inf rad"),
        (state(values=changed(2, 1e300)), rf"joint {NAMES[2]} is at 1e\+300 rad; its limits are"),
        (state(values=DEGREES), rf"joint {NAMES[1]} is at -[0-9.]+ rad; .* looks like degrees"),
        (state(values=HOME[:-1]), "6 names and 5 positions"),
        (state([*NAMES, NAMES[0]], [*HOME, 0.0]), f"joint {NAMES[0]} comes 2 times"),
    ],
    ids=["nan", "infinite", "huge", "degrees", "short", "twice"],
)
def test_a_bad_state_is_refused_at_once_and_where_the_arm_is_is_not_known_then(message, text):
    joints = JointListener(UR5, 0.5)
    joints.listen(state())
    began = monotonic()
    with pytest.raises(InvalidInputError, match=text):
        joints.listen(message)
    assert monotonic() < began + 0.2
    with pytest.raises(BusyError, match=f"/joint_states cannot be used: {text}"):
        joints.current  # noqa: B018 - raises
    joints.listen(state())
    np.testing.assert_array_equal(joints.current, HOME)


def test_a_part_of_the_joints_or_an_older_state_is_refused_and_the_one_before_stays():
    joints = JointListener(UR5, 0.5)
    joints.listen(state())
    for message, text in (
        (state(NAMES[:-1], HOME[:-1]), f"it has no {NAMES[-1]}; its joints are {NAMES[0]}"),
        (state(sec=99), r"its stamp is 1\.000 s before that of the last state"),
    ):
        with pytest.raises(InvalidInputError, match=text):
            joints.listen(message)
        np.testing.assert_array_equal(joints.current, HOME)


def test_noise_is_no_motion_and_a_slow_motion_is_one():
    joints, random = JointListener(UR5, 0.5), np.random.default_rng(0)
    for _ in range(50):
        joints.listen(state(values=(UR5.home + random.uniform(-1e-4, 1e-4, 6)).tolist()))
    assert joints.changed == -np.inf
    for step in range(20):
        joints.listen(state(values=changed(1, HOME[1] + 1e-4 * step)))
    assert joints.changed > -np.inf


def test_joints_of_others_matter_only_where_the_arm_is_silent(monkeypatch):
    joints, others = JointListener(UR5, 0.5), state(["finger"], [0.0])
    joints.listen(others)
    monkeypatch.setattr("sain_arm.ros.joint_listener.monotonic", lambda: monotonic() + 3.0)
    with pytest.raises(InvalidInputError, match="its joints are finger, and robot 'ur5' needs all"):
        joints.listen(others)
