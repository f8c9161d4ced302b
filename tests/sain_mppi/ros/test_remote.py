"""The planner's node and its model: behind the service, silent, wrong or not there."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.scene import POSITION
from sain_interfaces.msg import Plan
from sain_interfaces.srv import Rollout
from sain_mppi.ros.mppi_node import MppiNode
from tests.sain_mppi.ros.straw import GOAL, SMALL, START, nth_push, plan


class Remote:
    """A model's service that behaves as the test wants it."""

    def __init__(self, graph, answer):
        graph.bystander.create_service(Rollout, "rollout", self.on_rollout)
        self.answer, self.asked = answer, 0
        self.pasts = []

    def on_rollout(self, request, response):
        self.asked += 1
        self.pasts.append(wire.decode_past(request))
        scene, pushes = wire.decode_rollout_request(request)
        self.answer(scene, pushes, response)
        return response


def remote_planner(graph, **parameters):
    node = graph.start(MppiNode, **(SMALL | {"model_timeout": 0.5} | parameters))
    graph.wait(lambda: node.remote.ready, "the model's service")
    return node


def still(scene, pushes, response):
    response.error_code, response.model = int(ErrorCode.OK), "standing still"
    shape = (*pushes.shape[:2], *scene.shape)
    response.predicted = codec.encode_floats(np.broadcast_to(scene, shape))


def refuse(scene, pushes, response):
    response.error_code, response.error_message = int(ErrorCode.TOO_MUCH_WORK), "too much"


def short(scene, pushes, response):
    still(scene, pushes, response)
    response.predicted = response.predicted[:-1]


def test_the_service_is_used_when_it_answers(graph, straw):
    remote = Remote(graph, still)
    remote_planner(graph)
    graph.aim(GOAL, 1)
    straw.show()
    nth_push(graph, 1)
    made = plan(graph, goal_id=1)
    assert (made.fallback, made.dynamics) == (False, "standing still")
    assert remote.asked >= 2
    np.testing.assert_array_equal(wire.decode_plan(made)[1], np.stack([START] * 2))


def test_the_service_gets_the_episode_s_earlier_pushes_and_no_others(graph, straw):
    remote = Remote(graph, still)
    remote_planner(graph, result_patience=60.0)  # a scene waits for its result
    graph.aim(GOAL, 1)
    straw.show()
    first = nth_push(graph, 1)
    after = START.copy()
    after[:, POSITION] += 0.01
    straw.answer(first, ErrorCode.OK, before=START, after=after)
    straw.show(scene_id=2, disks=after)
    second = nth_push(graph, 2)
    assert {len(past) for past in remote.pasts} == {0, 1}
    known = remote.pasts[-1]
    np.testing.assert_array_equal(known.state[0], START)
    np.testing.assert_array_equal(known.action[0], wire.decode_push(first))
    np.testing.assert_array_equal(known.next_state[0], after)
    plan(graph, push_id=second.push_id)  # nothing more is asked for it
    straw.answer(second, ErrorCode.OK)  # a result without scenes teaches nothing
    asked = remote.asked
    straw.show(scene_id=3, episode_id=2)
    nth_push(graph, 3)
    known = [len(past) for past in remote.pasts[asked:]]  # first, perhaps, what the push prepares
    assert set(known[known.index(0) :]) == {0}


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (refuse, "the model refused: too much"),
        (short, "the model answered wrongly: predicted has 2047 numbers; 2048"),
    ],
)
def test_when_the_model_fails_physics_takes_over_and_says_so(graph, straw, answer, text):
    remote = Remote(graph, answer)
    remote_planner(graph)
    graph.aim(GOAL, 1)
    straw.show()
    nth_push(graph, 1)
    made = plan(graph, goal_id=1)
    assert (made.status, made.fallback, made.dynamics) == (Plan.PUSH, True, "planar")
    assert ErrorCode(made.error_code) is ErrorCode.MODEL_UNAVAILABLE
    assert text in made.error_message
    assert remote.asked == 1
    remote.answer = still
    straw.show(scene_id=2)
    assert not plan(graph, scene_id=2).fallback


@pytest.fixture
def silent(graph):
    """A service whose node is never spun: it takes requests and says nothing."""
    node = Node("silent", namespace="sain", context=graph.context)
    node.create_service(Rollout, "rollout", lambda request, response: response)
    yield node
    node.destroy_node()


def test_a_model_that_is_silent_is_waited_for_no_longer_than_allowed(graph, straw, silent):
    remote_planner(graph)
    graph.aim(GOAL, 1)
    straw.show()
    made = plan(graph, goal_id=1)
    assert (made.status, made.fallback) == (Plan.PUSH, True)
    assert made.error_message == "the model did not answer within 0.5 s"


@pytest.mark.parametrize("end", ["goal", "node"])
def test_a_silent_model_holds_up_neither_a_new_goal_nor_the_end(
    graph, straw, silent, monkeypatch, end
):
    asked = []

    def ask(*request):
        asked.append(request)
        return rollout(*request)

    node = remote_planner(graph, model_timeout=60.0)
    rollout = node.remote.rollout
    monkeypatch.setattr(node.remote, "rollout", ask)
    graph.aim(GOAL, 1)
    straw.show()
    graph.wait(lambda: asked, "a question to the model")
    began = time.monotonic()
    if end == "goal":
        graph.aim((0.65, 0.0), 2)
        graph.wait(lambda: len(asked) == 2, "a question for the new goal")
    graph.stop(node)
    assert time.monotonic() < began + 30.0


def test_while_a_plan_waits_for_its_model_a_new_goal_cancels_it(graph, straw):
    goals = []

    def answer(scene, pushes, response):
        if not goals:  # the plan for goal 1 waits for this answer
            goals.append(2)
            graph.aim((0.65, 0.0), 2)
        still(scene, pushes, response)

    Remote(graph, answer)
    remote_planner(graph, planner__rounds=4, model_timeout=30.0)
    graph.aim(GOAL, 1)
    straw.show()
    push = nth_push(graph, 1)
    assert plan(graph, push_id=push.push_id).goal_id == 2
    assert not graph.find("plan", goal_id=1)


class Starting:
    """What the node of a model says while it loads."""

    def __init__(self, graph):
        self.publisher = graph.bystander.create_publisher(DiagnosticArray, "/diagnostics", 10)
        graph.wait(lambda: self.publisher.get_subscription_count() == 1, "who hears diagnostics")
        status = DiagnosticStatus(level=DiagnosticStatus.WARN, name="/sain/model_node: predictions")
        status.message = "compiling 31 of 40 kernels"
        self.publisher.publish(DiagnosticArray(status=[status]))


def test_the_first_goal_waits_for_a_model_that_compiles_and_says_so(graph, straw):
    def said():
        statuses = [status for array in graph.heard["/diagnostics"] for status in array.status]
        return [status.message for status in statuses if "mppi_node" in status.name]

    node = graph.start(MppiNode, **SMALL)
    Starting(graph)
    graph.wait(lambda: node.remote.starting, "the model's word")
    graph.listen("/diagnostics", DiagnosticArray)
    graph.aim(GOAL, 1)
    straw.show()
    waits = "waits for the model: compiling 31 of 40 kernels"
    graph.wait(lambda: waits in said(), "the planner's word")
    Remote(graph, still)
    made = plan(graph, goal_id=1)
    assert (made.status, made.fallback, made.dynamics) == (Plan.PUSH, False, "standing still")
    assert made.planning_time < 5.0  # it does not count what it waited
