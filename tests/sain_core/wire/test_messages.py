"""Decoding takes anything with the right attributes; what `rclpy` gives is in ros/test_codec.py."""

from types import SimpleNamespace as Message

import pytest

from sain_core import wire
from sain_core.errors import InvalidInputError
from sain_core.push import PUSH_SIZE, pushed_bodies
from sain_core.scene import STATE_NAMES


def disk(**values: float) -> Message:
    return Message(**(dict.fromkeys(STATE_NAMES, 0.0) | values))


def test_what_is_not_finite_is_named():
    with pytest.raises(InvalidInputError, match="before: vy of disk 1 is nan; must be finite"):
        wire.decode_disks([disk(), disk(vy=float("nan"))], "before")
    with pytest.raises(InvalidInputError, match="angle of the push is inf; must be finite"):
        wire.decode_push(Message(body=0, location=0.0, angle=float("inf"), length=0.1, speed=0.1))
    with pytest.raises(InvalidInputError, match="x of the goal of body 1 is nan; it must be fin"):
        pose = Message(body=1, x=float("nan"), y=0.2, tolerance=0.0, has_heading=False)
        wire.decode_goal(Message(poses=[pose], keep=[], keep_tolerance=0.0))
    with pytest.raises(InvalidInputError, match="the goal has no poses; give one or more"):
        wire.decode_goal(Message(poses=[], keep=[], keep_tolerance=0.0))


def rollout(**values: object) -> Message:
    ok = {"samples": 2, "horizon": 1, "disks": 2, "scene": [0.0] * 16, "pushes": [0.0] * 10}
    return Message(**(ok | values))


def test_a_rollout_request_is_decoded():
    scene, pushes = wire.decode_rollout_request(rollout())
    assert (scene.shape, pushes.shape) == ((2, 8), (2, 1, PUSH_SIZE))
    _, named = wire.decode_rollout_request(rollout(pushes=[0.0] * 5 + [1.0] * 5))
    assert pushed_bodies(named).tolist() == [[0], [1]]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"samples": 0}, "samples is 0; it must be at least 1"),
        ({"horizon": 0}, "horizon is 0; it must be at least 1"),
        ({"disks": 0}, "disks is 0; it must be at least 1"),
        ({"disks": 3}, r"scene has 16 numbers; 24 were expected, for shape \(3, 8\)"),
        ({"pushes": [-1.0] * 10}, "pushes names body -1; there are bodies 0 to 1"),
        ({"samples": 3}, r"pushes has 10 numbers; 15 were expected, for shape \(3, 1, 5\)"),
        ({"pushes": [2.0] * 10}, "pushes names body 2; there are bodies 0 to 1"),
        ({"pushes": [0.5] * 10}, "pushes names body 0.5; there are bodies 0 to 1"),
    ],
)
def test_a_wrong_rollout_request_is_refused(values, message):
    with pytest.raises(InvalidInputError, match=message):
        wire.decode_rollout_request(rollout(**values))


def past(**values: object) -> Message:
    numbers = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 8.0, 0.07] * 4
    fields = {
        "disks": 2,
        "past": 2,
        "past_scenes": numbers,
        "past_pushes": [0.0] * 10,
        "past_next": numbers,
        "past_noise": [],
    }
    return Message(**(fields | values))


def test_the_past_is_decoded_and_may_be_empty():
    history = wire.decode_past(past())
    assert (len(history), history.disks) == (2, 2)
    none = wire.decode_past(past(past=0, past_scenes=[], past_pushes=[], past_next=[]))
    assert (len(none), none.disks) == (0, 2)
    assert history.noise is None
    noisy = wire.decode_past(past(past_noise=[0.001, 0.002, 0.003, 0.004]))
    assert noisy.noise.tolist() == [[0.001, 0.002], [0.003, 0.004]]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"past": 3}, "past_scenes has 32 numbers; 48 were expected"),
        ({"past": 0}, "past_scenes has 32 numbers; 0 were expected"),
        ({"disks": 0}, "disks is 0; it must be at least 1"),
        ({"past_pushes": [0.1] * 6}, "past_pushes has 6 numbers; 10 were expected"),
        ({"past_pushes": [float("nan")] * 10}, r"past_pushes at \(0, 0\) is nan"),
        ({"past_noise": [0.001]}, "past_noise has 1 numbers; 4 were expected"),
        ({"past_next": [0.5] * 32}, "a past push changed a mass or radius"),
    ],
)
def test_a_past_that_cannot_be_is_refused(values, message):
    with pytest.raises(InvalidInputError, match=message):
        wire.decode_past(past(**values))


def test_a_result_is_where_a_push_led():
    before, after = (Message(disks=[disk(x=x), disk(x=1.0)]) for x in (0.1, 0.2))
    push = Message(body=1, location=0.5, angle=0.1, length=0.05, speed=0.0)
    scene, action, next_scene = wire.decode_result(Message(before=before, after=after, push=push))
    assert (scene[0, 0], next_scene[0, 0], action.tolist()) == (0.1, 0.2, [1, 0.5, 0.1, 0.05, 0.2])
    after.disks.append(disk())
    with pytest.raises(InvalidInputError, match="a push led from 2 disks to 3; it cannot"):
        wire.decode_result(Message(before=before, after=after, push=push))
