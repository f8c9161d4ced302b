"""An error in a callback is an answer, and the node lives on."""

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from shape_msgs.msg import SolidPrimitive

from sain_core.errors import BusyError, ErrorCode, InvalidInputError, SainError, TooMuchWorkError
from sain_core.guarding.ros import reception
from sain_core.guarding.ros.reception import (
    Reception,
    check_sizes,
    emptied,
)
from sain_core.ros.qos import QUEUE
from sain_interfaces.action import Reach
from sain_interfaces.msg import Bodies, Body, DiskState, Goal, GoalPose, Push, PushResult, Scene
from sain_interfaces.srv import LoadModel, ResetScene, Rollout


@pytest.fixture
def node(graph) -> Node:
    return graph.add(Node("node", namespace="sain", context=graph.context))


def fail(error: Exception):
    def callback(*_):
        raise error

    return callback


@pytest.mark.parametrize(
    ("error", "code", "text", "defects"),
    [
        (BusyError("later"), ErrorCode.BUSY, "later", 0),
        (ZeroDivisionError("by 0"), ErrorCode.INTERNAL, "ZeroDivisionError: by 0", 1),
        (RuntimeError("x" * 10_000), ErrorCode.INTERNAL, "(10014 characters)", 1),
    ],
)
def test_an_error_of_a_service_is_its_reply(graph, node, error, code, text, defects):
    reception = Reception(node)
    reception.serve(LoadModel, "load_model", fail(error))
    for _ in range(2):
        reply = graph.call(LoadModel, "load_model", LoadModel.Request())
        assert ErrorCode(reply.error_code) is code
        assert text in reply.error_message
    assert reception.figures == {"received_load_model": 2, "defects": 2 * defects}


def test_a_request_that_is_too_large_does_not_reach_the_callback(graph, node):
    Reception(node).serve(LoadModel, "load_model", fail(AssertionError("it was called")))
    reply = graph.call(LoadModel, "load_model", LoadModel.Request(model="x" * 10_000))
    assert ErrorCode(reply.error_code) is ErrorCode.INVALID
    assert "model has 10000 characters" in reply.error_message


def test_a_message_that_fails_is_refused_with_the_error(graph, node):
    reception, refused = Reception(node), []
    error = ZeroDivisionError("by 0")
    reception.listen(Push, "push", fail(error), QUEUE, lambda *told: refused.append(told))
    graph.wait(lambda: graph.pushing.get_subscription_count() == 2, "who takes a push")
    graph.pushing.publish(Push(push_id=3))
    graph.pushing.publish(Push(push_id=4, source="x" * 10_000))
    graph.wait(lambda: len(refused) == 2, "the refusals")
    assert [(message.push_id, type(why).__name__) for message, why in refused] == [
        (3, "ZeroDivisionError"),
        (4, "InvalidInputError"),
    ]
    assert reception.figures == {"received_push": 2, "defects": 1}


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


def test_what_is_too_large_is_emptied_and_all_else_stays():
    message = framed(Push(push_id=7, source="me", length=0.1, disks=[DiskState()] * 33))
    assert emptied(message) == Push(push_id=7, source="me", length=0.1)
    check_sizes(message)


def test_an_array_of_numbers_has_a_limit(monkeypatch):
    monkeypatch.setattr(reception, "MOST_NUMBERS", 10)
    check_sizes(Rollout.Request(pushes=[0.0] * 10))
    with pytest.raises(InvalidInputError, match="pushes has 11 elements; at most 10"):
        check_sizes(Rollout.Request(pushes=[0.0] * 11))


def test_a_dimension_that_is_too_large_is_too_much_work():
    with pytest.raises(TooMuchWorkError):
        check_sizes(Rollout.Request(samples=2**31))
