"""Goals that no tool gets behind."""

import pytest

from sain_core.errors import UnreachableError
from sain_core.goal import Goal
from sain_mppi.objective.problem import Problem


@pytest.mark.parametrize(
    ("goal", "reachable"),
    [((0.80, 0.0), True), ((0.5, 0.3), True), ((0.95, 0.55), False), ((1.05, 0.0), False)],
)
def test_a_goal_that_no_tool_gets_behind_is_refused(scene, goal, reachable):
    if reachable:
        Problem.of(scene, Goal.place(*goal))
        return
    with pytest.raises(UnreachableError, match=rf"the goal \({goal[0]:.3f}, .*out of reach"):
        Problem.of(scene, Goal.place(*goal))
