"""The planner's node, its model in process: goals, scenes, refusals and what it publishes."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

import sain_bringup.ros.listener
from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.scene import POSITION
from sain_interfaces.msg import Plan
from sain_model.physics.planar import PlanarPrior
from sain_mppi.agent.dead_end import Cause
from sain_mppi.ros.plans import CAUSE, summary
from tests.sain_mppi.ros.straw import GOAL, START, nth_push, plan


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
    pushes, predicted = wire.decode_plan(made)
    np.testing.assert_array_equal(pushes[0], wire.decode_push(push))
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
    np.testing.assert_allclose(places[0], wire.decode_plan(made)[1][..., POSITION], atol=1e-6)
    assert made.rollout_time + made.cost_time < made.search_time < made.planning_time
    assert (made.concern, len(made.last_errors)) == ("", 0)


UNSERVED = [
    ((3.0, 0.0), 0.01, ErrorCode.OFF_TABLE, "(3.000, 0.000) m of body 1 is off the table"),
    ((np.nan, 0.0), 0.01, ErrorCode.INVALID, "must be finite"),
    ((1.1, 0.0), 0.01, ErrorCode.UNREACHABLE, "out of reach"),
    ((0.7, 0.0), 1e308, ErrorCode.OUT_OF_RANGE, "tolerance of body 1 is 1e+308 m; allowed:"),
]


def test_a_goal_that_cannot_be_served_gets_no_push(graph, straw, planner):
    straw.show()
    for goal_id, (goal, tolerance, code, text) in enumerate(UNSERVED, start=2):
        graph.aim(goal, goal_id, tolerance)
        refused = plan(graph, goal_id=goal_id)
        assert (refused.status, ErrorCode(refused.error_code)) == (Plan.NO_PUSH, code)
        assert text in refused.error_message
        assert text in summary(refused)["message"]  # of /diagnostics
    assert "; the nearest that is possible is (" in plan(graph, goal_id=2).error_message
    graph.aim(GOAL, 9)
    assert plan(graph, goal_id=9).push_id == nth_push(graph, 1).push_id
    assert len(graph.heard["push"]) == 1


def test_the_number_of_pushes_is_kept_and_refused_ones_do_not_count(graph, straw, planner):
    graph.aim(GOAL, 1, max_pushes=1)
    straw.show()
    straw.answer(nth_push(graph, 1), ErrorCode.BLOCKED)
    straw.answer(nth_push(graph, 2), ErrorCode.OK)
    straw.show(scene_id=2)
    assert plan(graph, scene_id=2).status == Plan.EXHAUSTED
    assert len(graph.heard["push"]) == 2


def test_after_three_pushes_that_bring_nothing_it_reports_why(graph, straw, planner):
    graph.listen("/diagnostics", DiagnosticArray)
    graph.aim(GOAL, 1)
    for number in range(1, 5):
        jolted = START.copy()
        jolted[0, 0] += 1e-4 * number
        straw.show(scene_id=number, disks=jolted)
        straw.answer(nth_push(graph, number), ErrorCode.OK)

    def reported():
        statuses = [one for array in graph.heard["/diagnostics"] for one in array.status]
        return [one for one in statuses if "3 pushes brought body 1 no nearer" in one.message]

    graph.wait(reported, "the reason")
    status = reported()[0]
    assert status.level == DiagnosticStatus.WARN
    assert {pair.key: pair.value for pair in status.values}[CAUSE] in set(Cause)
    assert CAUSE == sain_bringup.ros.listener.CAUSE  # so commands print it at once
    (fourth,) = graph.find("plan", push_id=nth_push(graph, 4).push_id)
    assert fourth.concern == status.message
