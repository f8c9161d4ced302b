"""A planner notices when pushes do not lead where they should, and when there is no way on."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.dynamics import IdentityPrior, StepwiseRollout
from sain_core.errors import NoProgressError, UnreachableError
from sain_core.feasibility import Feasibility
from sain_core.scene import MID, POSITION, TARGET
from sain_core.seeding import generator
from sain_mppi.loop.progress_monitor import Replanner
from sain_mppi.planner import Planner
from sain_mppi.search.config import PlannerConfig
from sain_mppi.search.goal import check_in_reach
from sain_mppi.search.progress import Progress, ProgressConfig

GOAL = np.array([0.68, 0.05])
CONFIG = PlannerConfig(samples=96, rounds=2)


def moved(scene, disk, way):
    other = scene.copy()
    other[disk, POSITION] += way
    return other


@pytest.fixture
def replanner(dynamics):
    return Replanner(Planner(StepwiseRollout(dynamics), CONFIG))


def plan(replanner, scene, number=0):
    return replanner.plan(scene, GOAL, generator(number))


def test_a_push_that_leads_where_it_should_is_no_concern(scene, replanner):
    first = plan(replanner, scene)
    then = plan(replanner, first.predicted[0], 1)
    assert first.last is None and first.concern == then.concern == ""
    np.testing.assert_array_equal(then.last.errors, [0.0, 0.0])
    way = np.linalg.norm((first.predicted[0] - scene)[:, POSITION], axis=1)
    np.testing.assert_allclose(then.last.expected, np.maximum(0.01, 0.3 * way))


@pytest.mark.parametrize(("disk", "name"), [(MID, "mid disk"), (TARGET, "target")])
def test_after_a_surprise_the_plan_is_wider_and_says_why(scene, replanner, disk, name):
    first = plan(replanner, scene)
    then = plan(
        replanner, moved(first.predicted[0], disk, [0.06 if disk == TARGET else -0.06, 0.0]), 1
    )
    assert then.concern.startswith(f"{name} 60 mm from where it should be")
    assert then.samples > first.samples
    assert then.last.errors[disk] == pytest.approx(0.06)


def test_what_the_model_is_not_sure_of_is_no_surprise(scene):
    progress = Progress(ProgressConfig())
    for regions, surprising in ((None, True), (np.array([0.0, 0.1]), False)):
        progress.expect(scene, moved(scene, TARGET, [0.02, 0.0]), regions)
        progress.look(moved(scene, TARGET, [0.05, 0.0]), 1.0)
        assert progress.last.surprising == surprising


def test_a_refused_push_and_a_scene_of_other_disks_are_no_surprise(scene, replanner):
    first = plan(replanner, scene)
    replanner.refuse(first.push)
    again = plan(replanner, scene, 1)
    more = np.concatenate([scene, moved(scene[:1], 0, [0.0, 0.3])])
    then = plan(replanner, more, 2)
    assert again.last is None and then.last is None
    assert again.concern == then.concern == ""


def test_pushes_that_bring_nothing_make_plans_wider_and_at_last_none(scene):
    model = StepwiseRollout(IdentityPrior())
    settings = ProgressConfig(stalled_after=2, give_up_after=4)
    replanner = Replanner(Planner(model, replace(CONFIG, progress=settings)))
    concerns = []
    with pytest.raises(NoProgressError, match="4 pushes in a row brought nothing, the target is"):
        for number in range(9):
            jolted = moved(scene, MID, [1e-4 * (number % 2), 0.0])
            concerns.append(plan(replanner, jolted, number).concern)
    assert concerns == ["", "", "2 pushes brought nothing", "3 pushes brought nothing"]
    replanner.reset()
    assert plan(replanner, scene).concern == ""


def test_a_way_round_the_target_counts_as_progress(scene, replanner):
    """The target does not move while the mid disk is brought behind it."""
    for step, bearing in enumerate(np.linspace(0.0, np.pi, 9)):
        around = scene.copy()
        around[TARGET, POSITION] = [0.50, 0.0]
        around[MID, POSITION] = around[TARGET, POSITION] + 0.15 * np.array(
            [np.cos(bearing), np.sin(bearing)]
        )
        result = plan(replanner, around, step)
        assert "brought nothing" not in result.concern


@pytest.mark.parametrize(
    ("goal", "reachable"),
    [((0.80, 0.0), True), ((0.5, 0.3), True), ((-0.6, 0.0), False), ((1.05, 0.0), False)],
)
def test_a_goal_that_no_tool_gets_behind_is_refused(scene, goal, reachable):
    if reachable:
        check_in_reach(np.array(goal), scene, Feasibility())
        return
    with pytest.raises(UnreachableError, match=rf"the goal \({goal[0]:.3f}, .*out of reach"):
        check_in_reach(np.array(goal), scene, Feasibility())
