"""Every text, array and stated dimension of a message has a limit, however deep it is."""

import pytest
from geometry_msgs.msg import PoseStamped
from shape_msgs.msg import SolidPrimitive

from sain_core.errors import InvalidInputError, SainError, TooMuchWorkError
from sain_core.guarding.ros import reception
from sain_core.guarding.ros.reception import check_sizes, emptied, shortened
from sain_interfaces.action import Reach
from sain_interfaces.msg import Bodies, Body, DiskState, Goal, GoalPose, Push, PushResult, Scene
from sain_interfaces.srv import LoadModel, ResetScene, Rollout

LONG = "x" * 5000


def framed(message):
    message.header.frame_id = LONG
    return message


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (Push(source=LONG), "source has 5000 characters; at most 256 are accepted"),
        (Push(disks=[DiskState()] * 33), "disks has 33 elements; at most 32 are accepted"),
        (framed(PoseStamped()), "frame_id has 5000 characters; at most 256"),
        (PushResult(after=Scene(disks=[DiskState()] * 33)), "disks has 33 elements; at most 32"),
        (PushResult(push=Push(source=LONG)), "source has 5000 characters"),
        (Bodies(bodies=[Body(name=LONG)]), "name has 5000 characters; at most 64"),
        (Bodies(bodies=[Body(parts=[SolidPrimitive()] * 13)]), "parts has 13 elements; at most 12"),
        (Reach.Goal(goal=Goal(poses=[GoalPose()] * 33)), "poses has 33 elements; at most 32"),
        (ResetScene.Request(shapes=["disk", LONG]), "shapes has 5000 characters; at most 64"),
        (ResetScene.Request(roles=[""] * 1025), "roles has 1025 elements; at most 1024"),
        (LoadModel.Request(model=LONG), "model has 5000 characters; at most 4096"),
        (Rollout.Request(samples=2**20 + 1), "samples is 1048577; at most 1048576"),
        (Rollout.Request(horizon=2**32 - 1), "horizon is 4294967295; at most 1024"),
        (Rollout.Request(past=4096), "past is 4096; at most 200"),
    ],
)
def test_what_is_too_large_is_named_with_its_limit(message, text):
    with pytest.raises(SainError, match=text):
        check_sizes(message)


def test_an_array_of_numbers_has_a_limit(monkeypatch):
    monkeypatch.setattr(reception, "MOST_NUMBERS", 10)
    check_sizes(Rollout.Request(pushes=[0.0] * 10))
    with pytest.raises(InvalidInputError, match="pushes has 11 elements; at most 10"):
        check_sizes(Rollout.Request(pushes=[0.0] * 11))


def test_a_dimension_that_is_too_large_is_too_much_work():
    with pytest.raises(TooMuchWorkError):
        check_sizes(Rollout.Request(samples=2**31))


def test_what_is_too_large_is_emptied_and_all_else_stays():
    message = framed(Push(push_id=7, source="me", length=0.1, disks=[DiskState()] * 33))
    assert emptied(message) == Push(push_id=7, source="me", length=0.1)
    check_sizes(message)


def test_a_long_error_is_cut_and_says_so():
    assert shortened("short") == "short"
    cut = shortened(LONG)
    assert len(cut) == reception.LONGEST_ERROR
    assert cut.endswith("x ... (5000 characters)")
