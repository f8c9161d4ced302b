"""Goals that no tool gets behind."""

import pytest

from sain_core.errors import UnreachableError
from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.shapes.bodies import PAPER_DISKS
from sain_mppi.objective.in_reach import check_in_reach


@pytest.mark.parametrize(
    ("goal", "reachable"),
    [((0.80, 0.0), True), ((0.5, 0.3), True), ((-0.6, 0.0), False), ((1.05, 0.0), False)],
)
def test_a_goal_that_no_tool_gets_behind_is_refused(scene, goal, reachable):
    if reachable:
        check_in_reach(Goal.place(*goal), scene, PAPER_DISKS, Feasibility())
        return
    with pytest.raises(UnreachableError, match=rf"the goal \({goal[0]:.3f}, .*out of reach"):
        check_in_reach(Goal.place(*goal), scene, PAPER_DISKS, Feasibility())
