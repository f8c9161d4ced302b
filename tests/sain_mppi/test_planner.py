"""The planner's promises, over a toy model that only knows how to push disks apart."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.push import LENGTH, SPEED, PushLimits, make_push
from sain_core.randomness import generator
from sain_core.scene import MID, POSITION, TARGET, make_scene, unit
from sain_core.shapes.bodies import PAPER_DISKS
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

CONFIG = PlannerConfig(samples=192)
GOAL = Goal.place(0.68, 0.05)


def problem(scene, goal=GOAL):
    return Problem.of(scene, goal)


def planner(dynamics, **changes):
    return Planner(dynamics, replace(CONFIG, **changes))


@pytest.mark.parametrize("bearing", [0.0, 2.0])
def test_it_brings_the_target_to_the_goal_from_any_side(dynamics, bearing):
    mid = np.array([0.45, 0.0])
    positions = np.stack([mid, mid + 0.141 * unit(np.float64(bearing))])
    scene = make_scene(positions, np.full(2, 8.0), np.array([0.08, 0.06]))
    goal, plans = Goal.place(0.45, 0.22), planner(dynamics)
    for step in range(12):
        if goal.judge(scene, scene, PAPER_DISKS).reached:
            break
        scene = dynamics.step(
            scene[None], plans.plan(problem(scene, goal), generator(2, step)).push[None]
        )[0]
    assert goal.judge(scene, scene, PAPER_DISKS).reached


def test_the_next_plan_starts_from_the_rest_of_the_last(scene, dynamics):
    first = planner(dynamics).plan(problem(scene), generator(0))
    small = planner(dynamics, samples=1, rounds=1, stuck_rounds=0, correction_within=0.0)
    then = small.plan(problem(first.predicted[0]), generator(1), first.rest)
    np.testing.assert_allclose(then.pushes[:-1], first.pushes[1:])


def test_the_plan_for_another_goal_is_no_start(scene, dynamics):
    plans = planner(dynamics)
    fresh = plans.plan(problem(scene), generator(1))
    other = plans.plan(problem(scene, Goal.place(0.6, -0.2)), generator(0))
    then = plans.plan(problem(scene), generator(1), other.rest)
    assert then.pushes.tobytes() == fresh.pushes.tobytes()


def prepared(scene, plans):
    """Return what was prepared after a push, and where that leads."""
    first = plans.plan(problem(scene), generator(0))
    expected = first.predicted[0]
    return plans.prepare(problem(expected), generator(1), first.rest), expected


def test_a_plan_that_was_prepared_is_corrected_with_few_samples(scene, dynamics):
    plans = planner(dynamics)
    start, expected = prepared(scene, plans)
    then = plans.plan(problem(expected), generator(2), start)
    anew = plans.plan(problem(expected), generator(2))
    assert then.rounds == 1 and then.samples <= CONFIG.correction + 16 < anew.samples
    assert then.cost < 0.1 * then.rest_cost  # `anew` likewise: three times the samples


def test_what_was_prepared_is_dropped_for_a_refusal_or_another_goal(scene, dynamics):
    plans = planner(dynamics)
    start, expected = prepared(scene, plans)

    def rounds(goal=GOAL, refused=()):
        asked = replace(problem(expected, goal), refused=refused)
        return plans.plan(asked, generator(2), start).rounds

    assert rounds() == 1
    assert rounds(refused=(make_push(3.0, 0.0, 0.1),)) == CONFIG.rounds
    assert rounds(goal=Goal.place(0.70, 0.07)) == CONFIG.rounds


def test_pushes_have_the_speeds_that_are_given_and_are_slow_near_the_goal(scene, dynamics):
    plans = planner(dynamics, speeds=(0.1, 0.3), correction_speed=0.05, correction_within=0.03)
    far = plans.plan(problem(scene), generator(0)).pushes
    np.testing.assert_allclose(far[far[:, LENGTH] > 0.0, SPEED], 0.1)  # one disk hits another
    for tolerance, speed in ((0.005, 0.05), (0.02, 0.1), (0.5, 0.3)):
        near = Goal.place(*scene[TARGET, POSITION] + [0.02, 0.0], tolerance)
        slow = plans.plan(problem(scene, near), generator(1)).pushes
        np.testing.assert_allclose(slow[:, SPEED], speed)
    slower = Feasibility(limits=PushLimits(max_speed=0.25))
    allowed = plans.plan(replace(problem(scene, near), feasibility=slower), generator(1)).pushes
    np.testing.assert_allclose(allowed[:, SPEED], 0.25)
    plans = replace(plans, careful=False)
    own = Goal.place(*scene[MID, POSITION] + [0.3, 0.0], body=MID)
    drawn = plans.plan(problem(scene, own), generator(0)).pushes
    assert 0.1 < drawn[0, SPEED] <= 0.3 + 1e-9, "faster costs less time"
