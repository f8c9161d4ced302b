"""An error in a callback is an answer, and the node lives on."""

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header

from sain_core.errors import BusyError, ErrorCode, InvalidInputError
from sain_core.guarding.ros.reception import LARGE_BYTES, MOST_BYTES, Reception, check_size
from sain_core.ros.qos import QUEUE
from sain_interfaces.msg import Bodies, Body, DiskState, Push, PushResult
from sain_interfaces.srv import LoadModel, ResetScene, Rollout


@pytest.fixture
def node(graph):
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


def test_a_message_that_fails_is_refused_with_the_error(graph, node):
    reception, refused = Reception(node), []
    error = ZeroDivisionError("by 0")
    reception.listen(Push, "push", fail(error), QUEUE, lambda *told: refused.append(told))
    graph.wait(lambda: graph.pushing.get_subscription_count() == 2, "who takes a push")
    graph.pushing.publish(Push(push_id=3))
    graph.pushing.publish(Push(push_id=4, source=LONG))
    graph.wait(lambda: len(refused) == 2, "the refusals")
    assert [(message.push_id, type(why).__name__) for message, why in refused] == [
        (3, "ZeroDivisionError"),
        (4, "InvalidInputError"),
    ]
    assert reception.figures == {"received_push": 2, "defects": 1}


def test_an_error_after_ctrl_c_is_not_reported(graph, node, monkeypatch):
    reception, refused = Reception(node), []
    take = reception.guarded("push", fail(RuntimeError("context is invalid")), refused.append)
    monkeypatch.setattr(node.context, "ok", lambda: False)
    take(Push())
    assert not refused and reception.figures["defects"] == 0


LONG = "x" * MOST_BYTES


@pytest.mark.parametrize(
    "message",
    [
        Push(source=LONG),
        Push(disks=[DiskState()] * 20_000),
        PoseStamped(header=Header(frame_id=LONG)),
        PushResult(push=Push(source=LONG)),
        Bodies(bodies=[Body(parts=[SolidPrimitive()] * 100_000)]),
        ResetScene.Request(shapes=["disk", LONG]),
        LoadModel.Request(model=LONG),
        Rollout.Request(pushes=[0.0] * (MOST_BYTES // 8)),
    ],
)
def test_what_is_too_large_is_named_with_its_limit_and_emptied(message):
    with pytest.raises(InvalidInputError, match=r"has \d{7} bytes; at most 1048576 are accepted"):
        check_size(message)
    check_size(message)


def test_a_request_that_is_too_large_does_not_reach_the_callback(graph, node):
    Reception(node).serve(LoadModel, "load_model", fail(AssertionError("it was called")))
    reply = graph.call(LoadModel, "load_model", LoadModel.Request(model=LONG))
    assert ErrorCode(reply.error_code) is ErrorCode.INVALID
    assert "bytes; at most 1048576 are accepted" in reply.error_message


def test_ids_and_numbers_of_what_is_emptied_stay_and_a_topic_may_have_its_own_limit():
    message = Push(push_id=7, source=LONG, length=0.1, disks=[DiskState()] * 33)
    check_size(message, LARGE_BYTES)
    with pytest.raises(InvalidInputError, match="at most 1000 are accepted"):
        check_size(message, 1000)
    assert message == Push(push_id=7, length=0.1)
