"""Settings of the planner as rqt_reconfigure and `ros2 param set` change them."""

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from sain_core.errors import ErrorCode
from sain_core.scene import POSITION
from tests.sain_mppi.ros.straw import GOAL, START, nth_push, plan


@pytest.fixture
def change(graph, planner):
    def change(**values):
        given = [Parameter(name.replace("__", "."), value=value) for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=[p.to_parameter_msg() for p in given])
        return graph.call(
            SetParametersAtomically, "mppi_node/set_parameters_atomically", request
        ).result

    return change


def test_the_next_plan_is_made_with_what_was_set(graph, straw, change):
    graph.aim(GOAL, 1)
    straw.show()
    first = plan(graph, push_id=nth_push(graph, 1).push_id)
    assert (first.samples, first.horizon, first.algorithm) == (64, 2, "mppi_rounds")
    settings = {"samples": 40, "horizon": 3, "algorithm": "mppi", "deadline": 30.0}
    settings |= {"weights__position": [200.0, 100.0], "weights__duration": 0.0}
    done = change(**{f"planner__{name}": value for name, value in settings.items()})
    assert (done.successful, done.reason) == (True, "")
    straw.answer(nth_push(graph, 1), ErrorCode.OK, before=START, after=START)
    moved = START.copy()
    moved[:, POSITION] += [0.0, -0.05]
    straw.show(scene_id=2, disks=moved)
    second = plan(graph, push_id=nth_push(graph, 2).push_id)
    assert (second.samples, second.horizon, second.algorithm) == (40, 3, "mppi")
    assert (second.deadline, len(second.pushes)) == (30.0, 3 * 5)
    assert dict(zip(second.cost_terms, second.cost_values, strict=True))["duration"] == 0.0


REFUSED = [
    ({"planner__samples": 0}, "planner.samples out of range. Min: 1, Max: 1000000"),
    ({"planner__algorithm": "best"}, "planner 'best' is unknown; known: exhaustive,"),
    (
        {"planner__weights__position": [1.0, -2.0]},
        "parameter 'planner.weights.position'[1] is -2.0 1/m^2; it must be at least 0.0 1/m^2",
    ),
    ({"model": "sain"}, "read-only parameter: model"),
    # All or nothing: the good one beside a bad one is not set either.
    ({"planner__horizon": 3, "planner__samples": 0}, "planner.samples out of range"),
]


def test_what_cannot_be_is_refused_with_the_reason_and_nothing_changes(planner, change):
    for values, reason in REFUSED:
        done = change(**values)
        assert not done.successful
        assert reason in done.reason
        assert planner.get_parameter("planner.horizon").value == 2
        assert planner.config.planner == planner.agent.decider._config
        assert planner.config.planner.samples == 64
