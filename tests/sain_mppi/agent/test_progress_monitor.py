"""A decider notices when pushes do not lead where they should, and when there is no way on."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import NoProgressError
from sain_core.goal import Goal
from sain_core.model import IdentityPrior
from sain_core.push import SPEED
from sain_core.randomness import generator
from sain_core.scene import MID, POSITION, TARGET
from sain_mppi.agent.events import PlanJob, SceneObserved, Task
from sain_mppi.agent.planning import PlanningDecider, ProgressMonitor
from sain_mppi.config import PlannerConfig, ProgressConfig
from sain_mppi.objective.problem import Problem

TASK = Task(1, 0, Goal.place(0.68, 0.05, 0.01), 0)
CONFIG = PlannerConfig(samples=96, rounds=2)


def moved(scene, disk, way):
    other = scene.copy()
    other[disk, POSITION] += way
    return other


def decider_over(dynamics, config=CONFIG):
    model = dynamics
    return PlanningDecider(model, model, config)


@pytest.fixture
def decider(dynamics):
    return decider_over(dynamics)


def decide(decider, scene, number=0, **changes):
    job = PlanJob(
        TASK, SceneObserved(scene, 1, 1 + number), Problem.of(scene, TASK.goal), 1, number
    )
    return decider.decide(replace(job, **changes), generator(number))


@pytest.mark.parametrize(("disk", "name"), [(MID, "mid disk"), (TARGET, "target")])
def test_after_a_surprise_the_plan_is_wider_and_says_why(scene, decider, disk, name):
    first = decide(decider, scene)
    way = [0.06 if disk == TARGET else -0.06, 0.0]
    then = decide(decider, moved(first.predicted, disk, way), 1)
    assert then.warning.startswith(f"{name} 60 mm from where it should be")
    assert then.plan.samples > first.plan.samples
    assert then.last_errors[disk] == pytest.approx(0.06)


def test_an_error_inside_the_model_s_region_is_no_surprise(scene):
    monitor = ProgressMonitor(ProgressConfig())
    for regions, surprising in ((None, True), (np.array([0.0, 0.1]), False)):
        monitor.expect(scene, moved(scene, TARGET, [0.02, 0.0]), regions)
        monitor.observe(moved(scene, TARGET, [0.05, 0.0]), 1.0)
        assert bool(monitor.warning) == surprising


def test_pushes_that_bring_nothing_make_plans_wider_and_at_last_none(scene):
    settings = ProgressConfig(stalled_after=2, give_up_after=4)
    decider = decider_over(IdentityPrior(), replace(CONFIG, progress=settings))
    concerns, ends = [], []
    with pytest.raises(NoProgressError, match=r"^4 pushes brought body 1 no nearer: .* 148 mm"):
        for number in range(9):
            jolted = moved(scene, MID, [1e-4 * (number % 2), 0.0])
            decision = decide(decider, jolted, number)
            concerns.append(decision.warning)
            ends.append(decision.dead_end)
    assert concerns == ["", "", "2 pushes brought nothing", "3 pushes brought nothing"]
    assert [None if end is None else end.pushes for end in ends] == [None, None, 2, 3]
    assert decide(decider, scene, session=2).warning == ""


def test_nudges_that_hardly_lower_the_cost_are_a_dead_end(scene):
    monitor = ProgressMonitor(ProgressConfig())
    counts = []
    for number, cost in enumerate((1.0, 0.97, 0.94, 0.91, 0.88)):
        monitor.expect(scene, scene)
        monitor.observe(moved(scene, MID, [1e-3 * number, 0.0]), cost)
        counts.append(monitor.stalled)
    assert counts == [0, 1, 2, 3, 0]
    assert monitor.without == 0


def test_pushes_near_the_goal_are_slow_but_for_the_first_one(scene, dynamics):
    near = scene.copy()
    near[TARGET, POSITION] = [0.66, 0.05]
    near[MID, POSITION] = [0.50, 0.02]
    decider = decider_over(dynamics)
    first = decide(decider, near)
    assert first.plan.push[SPEED] == pytest.approx(PlannerConfig().speeds[0])
    then = decide(decider, moved(first.predicted, MID, [0.001, 0.0]), 1)
    assert then.plan.push[SPEED] == pytest.approx(CONFIG.correction_speed)
