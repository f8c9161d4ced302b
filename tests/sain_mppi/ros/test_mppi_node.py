"""The planner's node against a simulator of straw: this test itself answers its pushes."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from visualization_msgs.msg import Marker

from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.ros.qos import RELIABLE
from sain_core.scene import POSITION, make_scene
from sain_interfaces.msg import Plan, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import Rollout
from sain_model.physics.planar import PlanarPrior
from sain_mppi.ros.mppi_node import MppiNode

SMALL = {"planner__samples": 64, "planner__rounds": 2, "planner__horizon": 2}
GOAL = (0.70, 0.05)
START = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)


class Straw:
    """Says what a simulator says, as the test wants it."""

    def __init__(self, graph):
        self.graph = graph
        self.scenes = graph.bystander.create_publisher(SceneMessage, "scene", RELIABLE)
        self.results = graph.bystander.create_publisher(PushResult, "push_result", RELIABLE)

    def show(self, scene_id=1, episode_id=1, disks=START, settled=True):
        self.graph.wait(self.scenes.get_subscription_count, "who looks at the scene")
        stamp = self.graph.bystander.get_clock().now().to_msg()
        message = codec.encode_scene(
            disks, stamp=stamp, episode_id=episode_id, scene_id=scene_id, settled=settled
        )
        self.scenes.publish(message)

    def answer(self, push, code, message="", before=None, after=None):
        result = PushResult(
            push_id=push.push_id,
            episode_id=push.episode_id,
            error_code=int(code),
            error_message=message,
            push=push,
        )
        if before is not None:
            result.before.disks = codec.encode_disks(before)
            result.after.disks = codec.encode_disks(after)
        self.results.publish(result)


@pytest.fixture
def straw(graph):
    straw = Straw(graph)
    graph.wait(lambda: straw.scenes.get_subscription_count() == 1, "the bystander")
    return straw


@pytest.fixture
def planner(graph, straw):
    node = graph.start(MppiNode, dynamics="in_process", model="planar", **SMALL)
    graph.wait(lambda: straw.scenes.get_subscription_count() == 2, "the planner")
    graph.wait(lambda: graph.aiming.get_subscription_count() == 1, "the planner")
    return node


def plan(graph, **fields):
    graph.wait(lambda: graph.find("plan", **fields), f"a plan with {fields}")
    return graph.find("plan", **fields)[0]


def nth_push(graph, number):
    graph.wait(lambda: len(graph.heard["push"]) >= number, f"push {number}")
    return graph.heard["push"][number - 1]


def test_a_settled_scene_is_answered_with_one_push_and_its_plan(graph, straw, planner):
    graph.aim(GOAL, 1)
    straw.show(settled=False)
    straw.show(scene_id=4)
    push = nth_push(graph, 1)
    assert (push.episode_id, push.scene_id, push.source) == (1, 4, "/sain/mppi_node")
    made = plan(graph, push_id=push.push_id)
    assert (made.status, made.error_code, made.fallback) == (Plan.PUSH, ErrorCode.OK, False)
    assert (made.goal_id, made.episode_id, made.scene_id) == (1, 1, 4)
    assert (made.samples, made.horizon, made.disks, made.dynamics) == (64, 2, 2, "planar")
    pushes, predicted = codec.decode_plan(made)
    np.testing.assert_array_equal(pushes[0], codec.decode_push(push))
    np.testing.assert_array_equal(predicted[0], PlanarPrior().step(START[None], pushes[:1])[0])
    assert made.goal_distance == pytest.approx(np.hypot(0.70 - 0.541, 0.05))
    assert made.planning_time >= made.rollout_time > 0.0


def test_a_plan_says_what_it_costs_what_else_was_tried_and_where_its_time_went(
    graph, straw, planner
):
    graph.aim(GOAL, 1)
    straw.show()
    made = plan(graph, push_id=nth_push(graph, 1).push_id)
    assert dict(zip(made.cost_terms, made.cost_values, strict=True))["position"] > 0.0
    assert sum(made.cost_values) == pytest.approx(made.cost)
    assert made.cost < made.rest_cost
    assert (made.algorithm, made.rollouts, made.rounds) == ("mppi_rounds", 96, 2)
    places = np.array(made.other_places).reshape(len(made.other_costs), 2, 2, 2)
    assert list(made.other_costs) == sorted(made.other_costs)
    np.testing.assert_allclose(places[0], codec.decode_plan(made)[1][..., POSITION], atol=1e-6)
    assert made.rollout_time + made.cost_time < made.search_time < made.planning_time
    assert (made.concern, len(made.last_errors)) == ("", 0)


def test_a_plan_says_how_the_last_push_came_out_and_looks_further_after_a_surprise(
    graph, straw, planner
):
    graph.aim(GOAL, 1)
    straw.show()
    first = nth_push(graph, 1)
    after = PlanarPrior().step(START[None], codec.decode_push(first)[None])[0]
    after[1, POSITION] += [0.0, 0.05]
    straw.answer(first, ErrorCode.OK, before=START, after=after)
    straw.show(scene_id=2, disks=after)
    made = plan(graph, push_id=nth_push(graph, 2).push_id)
    np.testing.assert_allclose(made.last_errors, [0.0, 0.05], atol=1e-9)
    assert made.last_expected[1] < 0.05
    assert made.concern.startswith("target 50 mm from where it should be")
    assert made.rollouts == 2 * 96


def test_another_episode_begins_without_a_past(graph, straw, planner):
    graph.aim(GOAL, 1)
    straw.show()
    straw.answer(nth_push(graph, 1), ErrorCode.OK, before=START, after=START)
    elsewhere = START.copy()
    elsewhere[:, POSITION] += [0.05, -0.1]
    straw.show(episode_id=2, scene_id=2, disks=elsewhere)
    made = plan(graph, push_id=nth_push(graph, 2).push_id)
    assert (made.concern, len(made.last_errors)) == ("", 0)


def test_disks_may_come_and_go_between_scenes(graph, straw, planner):
    graph.aim(GOAL, 1)
    third = make_scene(
        np.array([(0.40, 0.0), (0.541, 0.0), (0.45, 0.30)]), np.full(3, 8.0), np.full(3, 0.06)
    )
    for number, disks in enumerate((START, third, START), start=1):
        straw.show(scene_id=number, disks=disks)
        push = nth_push(graph, number)
        made = plan(graph, push_id=push.push_id)
        assert (made.disks, made.error_code) == (len(disks), ErrorCode.OK)
        straw.answer(push, ErrorCode.OK, before=disks, after=disks)


def test_a_goal_that_the_arm_cannot_push_to_is_refused_and_not_pushed_at(graph, straw, planner):
    graph.aim((1.10, 0.0), 1)
    straw.show()
    made = plan(graph, goal_id=1)
    assert (made.status, ErrorCode(made.error_code)) == (Plan.NO_PUSH, ErrorCode.UNREACHABLE)
    assert "out of reach" in made.error_message
    assert not graph.heard["push"]


def test_viewers_get_the_plan_what_else_was_tried_and_a_ghost(graph, straw, planner):
    graph.aim(GOAL, 1)
    straw.show()
    made = plan(graph, push_id=nth_push(graph, 1).push_id)
    graph.wait(lambda: graph.heard["plan_markers"], "markers")
    markers = {(m.ns, m.id): m for m in graph.heard["plan_markers"][0].markers}
    others = markers["others", 0]
    assert len(others.points) == len(others.colors) == 2 * 2 * len(made.other_costs)
    predicted = codec.decode_plan(made)[1]
    for disk in (0, 1):
        ghost = markers["ghost", disk]
        assert (ghost.pose.position.x, ghost.pose.position.y) == tuple(predicted[0, disk, POSITION])
        assert markers["region", disk].action == Marker.DELETE  # physics tells of none
        assert len(markers["path", disk].points) == 3


def test_the_same_scene_is_planned_once_for_each_goal(graph, straw, planner):
    graph.aim(GOAL, 1)
    for _ in range(3):
        straw.show()
    nth_push(graph, 1)
    graph.aim((0.65, 0.0), 2)
    second = nth_push(graph, 2)
    straw.show()
    assert plan(graph, push_id=second.push_id).goal_id == 2
    straw.show(scene_id=2)
    third = nth_push(graph, 3)
    assert third.scene_id == 2
    plan(graph, push_id=third.push_id)
    assert len(graph.heard["plan"]) == 3


def test_at_the_goal_there_is_nothing_to_push(graph, straw, planner):
    graph.aim(START[1, POSITION] + 0.001, 1, tolerance=0.005)
    straw.show()
    reached = plan(graph, goal_id=1)
    assert (reached.status, reached.push_id) == (Plan.REACHED, 0)
    assert reached.goal_distance == pytest.approx(0.001 * np.sqrt(2))
    assert not graph.heard["push"]


@pytest.mark.parametrize(
    ("goal", "tolerance", "code", "text"),
    [
        ((3.0, 0.0), 0.01, ErrorCode.OFF_TABLE, "(3.000, 0.000) m is off the table"),
        ((np.nan, 0.0), 0.01, ErrorCode.INVALID, "must be finite"),
        ((0.7, 0.0), -0.01, ErrorCode.OUT_OF_RANGE, "the tolerance is -0.01 m"),
        ((0.7, 0.0), np.nan, ErrorCode.OUT_OF_RANGE, "the tolerance is nan m"),
    ],
)
def test_a_goal_that_cannot_be_served_gets_no_push(
    graph, straw, planner, goal, tolerance, code, text
):
    straw.show()
    graph.aim(goal, 5, tolerance)
    refused = plan(graph, goal_id=5)
    assert (refused.status, ErrorCode(refused.error_code)) == (Plan.NO_PUSH, code)
    assert text in refused.error_message
    graph.aim(GOAL, 6)
    assert plan(graph, goal_id=6).push_id == nth_push(graph, 1).push_id
    assert len(graph.heard["push"]) == 1


def test_a_push_refused_for_itself_is_replaced_by_another(graph, straw, planner):
    graph.aim(GOAL, 1)
    straw.show()
    first = nth_push(graph, 1)
    straw.answer(first, ErrorCode.BLOCKED, "in the way")
    second = nth_push(graph, 2)
    assert second.push_id != first.push_id
    assert second.scene_id == first.scene_id
    assert np.abs(codec.decode_push(second) - codec.decode_push(first)).max() > 0.01


@pytest.mark.parametrize("code", [ErrorCode.STALE_SCENE, ErrorCode.BUSY, ErrorCode.UNKNOWN_EPISODE])
def test_a_push_refused_for_its_scene_waits_for_the_next_one(graph, straw, planner, code):
    graph.aim(GOAL, 1)
    straw.show()
    first = nth_push(graph, 1)
    straw.answer(first, code)
    straw.show(scene_id=2)
    assert nth_push(graph, 2).scene_id == 2


def test_a_planner_that_is_refused_again_and_again_gives_up(graph, straw):
    graph.start(MppiNode, dynamics="in_process", model="planar", pursuit__max_refusals=2, **SMALL)
    graph.aim(GOAL, 1)
    straw.show()
    for number in (1, 2):
        straw.answer(nth_push(graph, number), ErrorCode.UNREACHABLE, "too far")
    made = plan(graph, status=Plan.NO_PUSH)
    assert ErrorCode(made.error_code) is ErrorCode.NO_PUSH
    assert "2 pushes in a row were refused" in made.error_message


def test_the_number_of_pushes_is_kept_and_refused_ones_do_not_count(graph, straw, planner):
    graph.aim(GOAL, 1, max_pushes=1)
    straw.show()
    straw.answer(nth_push(graph, 1), ErrorCode.BLOCKED)
    straw.answer(nth_push(graph, 2), ErrorCode.OK)
    straw.show(scene_id=2)
    assert plan(graph, scene_id=2).status == Plan.EXHAUSTED
    assert len(graph.heard["push"]) == 2


def test_a_goal_of_another_episode_waits_for_that(graph, straw, planner):
    graph.aim(GOAL, 1, episode_id=2)
    straw.show(episode_id=1)
    straw.show(episode_id=2, scene_id=2)
    assert nth_push(graph, 1).episode_id == 2


def test_a_scene_that_holds_nan_is_ignored(graph, straw, planner):
    broken = START.copy()
    broken[1, 0] = np.nan
    graph.aim(GOAL, 1)
    straw.show(scene_id=1, disks=broken)
    straw.show(scene_id=2)
    assert nth_push(graph, 1).scene_id == 2


def test_a_target_off_the_table_gets_no_push(graph, straw, planner):
    fallen = START.copy()
    fallen[1, 0] = 1.5
    graph.aim(GOAL, 1)
    straw.show(disks=fallen)
    made = plan(graph, goal_id=1)
    assert (made.status, ErrorCode(made.error_code)) == (Plan.NO_PUSH, ErrorCode.OFF_TABLE)


def test_the_seed_decides_the_plan(graph, straw, planner):
    def push_of(seed):
        node = graph.start(MppiNode, dynamics="in_process", model="planar", seed=seed, **SMALL)
        count = len(graph.heard["push"])
        straw.show()
        push = nth_push(graph, count + 1)
        graph.stop(node)
        return codec.decode_push(push)

    graph.stop(planner)
    graph.aim(GOAL, 1)
    first, same, other = push_of(1), push_of(1), push_of(2)
    np.testing.assert_array_equal(first, same)
    assert (first != other).any()


class Remote:
    """A model's service that behaves as the test wants it."""

    def __init__(self, graph, answer):
        graph.bystander.create_service(Rollout, "rollout", self.on_rollout)
        self.answer, self.asked = answer, 0
        self.pasts = []

    def on_rollout(self, request, response):
        self.asked += 1
        self.pasts.append(codec.decode_past(request))
        scene, pushes = codec.decode_rollout_request(request)
        self.answer(scene, pushes, response)
        return response


def remote_planner(graph, **parameters):
    node = graph.start(MppiNode, **(SMALL | {"model_timeout": 0.5} | parameters))
    graph.wait(node.remote._client.service_is_ready, "the model's service")
    return node


def still(scene, pushes, response):
    response.error_code, response.model = int(ErrorCode.OK), "standing still"
    shape = (*pushes.shape[:2], *scene.shape)
    response.predicted = codec.encode_floats(np.broadcast_to(scene, shape))


def refuse(scene, pushes, response):
    response.error_code, response.error_message = int(ErrorCode.TOO_MUCH_WORK), "too much"


def nan(scene, pushes, response):
    still(scene, pushes, response)
    response.predicted[3] = float("nan")


def elsewhere(scene, pushes, response):
    still(scene + 0.01, pushes, response)


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
    np.testing.assert_array_equal(codec.decode_plan(made)[1], np.stack([START] * 2))


def test_the_service_is_told_of_the_episode_s_earlier_pushes_and_of_no_others(graph, straw):
    remote = Remote(graph, still)
    node = remote_planner(graph)
    graph.aim(GOAL, 1)
    straw.show()
    first = nth_push(graph, 1)
    after = START.copy()
    after[:, POSITION] += 0.01
    straw.answer(first, ErrorCode.OK, before=START, after=after)
    graph.wait(lambda: len(node.memory.of(1, 2)) == 1, "the result to be remembered")
    straw.show(scene_id=2, disks=after)
    second = nth_push(graph, 2)
    assert {len(past) for past in remote.pasts} == {0, 1}
    known = remote.pasts[-1]
    np.testing.assert_array_equal(known.scenes[0], START)
    np.testing.assert_array_equal(known.pushes[0], codec.decode_push(first))
    np.testing.assert_array_equal(known.next_scenes[0], after)
    plan(graph, push_id=second.push_id)  # nothing more is asked for it
    straw.answer(second, ErrorCode.OK)  # a result without scenes teaches nothing
    asked = remote.asked
    straw.show(scene_id=3, episode_id=2)
    nth_push(graph, 3)
    assert {len(past) for past in remote.pasts[asked:]} == {0}
    assert len(node.memory.of(1, 2)) == 1


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (refuse, "the model refused: too much"),
        (nan, "is nan; must be finite"),
        (elsewhere, "it answered for another scene"),
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


def test_a_model_that_is_sure_of_its_regions_gets_them_into_the_plan(graph, straw):
    graph.start(MppiNode, dynamics="in_process", model="sain", **SMALL)
    graph.aim(GOAL, 1)
    straw.show()
    made = plan(graph, push_id=nth_push(graph, 1).push_id)
    regions = np.array(made.regions).reshape(2, 2)
    assert (regions > 0.0).all() and (regions < 0.1).all()
    graph.wait(lambda: graph.heard["plan_markers"], "markers")
    markers = {(m.ns, m.id): m for m in graph.heard["plan_markers"][0].markers}
    marker = markers["region", 1]
    assert (marker.action, marker.scale.x) == (Marker.ADD, 2 * regions[0, 1])


def test_the_planner_says_when_it_sees_its_model(graph, straw):
    def levels():
        statuses = [status for array in graph.heard["/diagnostics"] for status in array.status]
        return [(s.level, s.message) for s in statuses if s.name == "/sain/mppi_node"]

    graph.listen("/diagnostics", DiagnosticArray)
    node = graph.start(MppiNode, **SMALL)
    graph.wait(lambda: len(levels()) > 1, "the planner's diagnostics")
    assert set(levels()) == {
        (DiagnosticStatus.WARN, "no model serves rollout yet: plans rest on the prior")
    }
    Remote(graph, still)
    graph.wait(lambda: levels()[-1] == (DiagnosticStatus.OK, "ready"), "the planner's word")
    assert node.remote.ready


def test_without_a_model_physics_plans(graph, straw):
    graph.start(MppiNode, **SMALL)
    graph.aim(GOAL, 1)
    straw.show()
    made = plan(graph, goal_id=1)
    assert (made.status, made.fallback) == (Plan.PUSH, True)
    assert made.error_message == "no model serves /sain/rollout"


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


def test_a_silent_model_does_not_keep_a_plan_past_its_deadline(graph, straw, silent):
    remote_planner(graph, planner__deadline=0.3, model_timeout=30.0)
    graph.aim(GOAL, 1)
    straw.show()
    made = plan(graph, goal_id=1)
    assert (made.status, made.fallback, made.dynamics) == (Plan.PUSH, True, "planar")
    assert made.deadline == 0.3
    assert made.error_message.startswith("the model did not answer within 0.2")


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


def test_while_a_plan_waits_for_its_model_a_reset_cancels_it(graph, straw):
    resets = []

    def answer(scene, pushes, response):
        if not resets:  # the plan for episode 1 waits for this answer
            resets.append(2)
            straw.show(scene_id=2, episode_id=2)
        still(scene, pushes, response)

    Remote(graph, answer)
    remote_planner(graph, planner__rounds=4, model_timeout=30.0)
    graph.aim(GOAL, 1)
    straw.show()
    push = nth_push(graph, 1)
    assert (push.episode_id, push.scene_id) == (2, 2)
    assert not graph.find("plan", episode_id=1)
