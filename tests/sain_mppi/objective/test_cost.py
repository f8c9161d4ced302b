"""Cost terms: what they punish, and that most of them do not care which way is north."""

from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.push import DEFAULT_SPEED, LENGTH, LOCATION, idle_pushes
from sain_core.randomness import generator
from sain_core.scene import MID, POSITION, RADIUS, TARGET, unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_mppi.config import CostWeights
from sain_mppi.objective import cost
from sain_mppi.objective.cost import (
    AGAIN,
    LOOK,
    TRAVEL_SPEED,
    Objective,
    Rollout,
    duration,
    missed,
    pose_distance,
    total_cost,
    way_around,
)
from sain_mppi.objective.problem import Problem
from tests.strokes import rotate_pushes, rotate_scenes

FEASIBILITY = Feasibility()
WEIGHTS = CostWeights()
TURNING = ("position", "distance", "alignment", "approach", "clearance", "duration")


def problem_of(scene, goal, bodies=PAPER_DISKS):
    return Problem(scene, goal, bodies.fitted(len(scene)), scene, FEASIBILITY)


def terms_of(scene, pushes, predicted, goal, weights=WEIGHTS):
    return Objective(problem_of(scene, Goal.place(*goal)), weights).terms(pushes, predicted)


def rest_terms(scene, goal, **weights):
    rest, weights = np.stack([[scene, scene]]), replace(WEIGHTS, **weights)
    terms = terms_of(scene, idle_pushes(1, 2), rest, goal, weights)
    return {name: float(value[0]) for name, value in terms.items()}


@pytest.mark.parametrize("angle", [0.7, -2.4, np.pi])
def test_turning_scene_pushes_and_goal_together_changes_no_cost(scene, dynamics, angle):
    goal = np.array([0.5, 0.25])
    pushes = FEASIBILITY.limits.sample(generator(0), 64 * 4).reshape(64, 4, 5)
    predicted = dynamics.rollout(scene, pushes)
    terms = terms_of(scene, pushes, predicted, goal)
    c, s = np.cos(angle), np.sin(angle)
    turned_goal = np.array([[c, -s], [s, c]]) @ goal
    turned = terms_of(
        rotate_scenes(scene, angle),
        rotate_pushes(pushes, angle),
        rotate_scenes(predicted, angle),
        turned_goal,
    )
    for name in TURNING:
        np.testing.assert_allclose(turned[name], terms[name], atol=1e-9, err_msg=name)


def test_position_is_the_papers_weighted_square(scene):
    goal = scene[TARGET, POSITION] + [0.1, 0.2]
    terms = rest_terms(scene, goal, position=(10.0, 100.0), running=0.0)
    assert terms["position"] == pytest.approx(10.0 * 0.01 + 100.0 * 0.04)


def test_a_mid_disk_that_the_tool_can_only_push_further_away_costs_unless_the_goal_asks(scene):
    def around(away, goal):
        after = scene.copy()
        after[MID, POSITION] = away * unit(np.asarray(0.3))
        terms = terms_of(scene, idle_pushes(1, 1), after[None, None], goal)
        return float(terms["around"][0])

    limits, reach = FEASIBILITY.limits, FEASIBILITY.reach
    beside = scene[MID, RADIUS] + limits.tool_radius + limits.clearance
    last = np.sqrt(reach.outer**2 - beside**2)  # with the tool beside it, at the end of the reach
    near, far = (0.5, 0.0), (0.95, 0.0)
    assert around(last, near) == pytest.approx(0.0)
    assert around(last + 0.03, near) == pytest.approx(WEIGHTS.around * 0.03)
    there = scene[TARGET, POSITION]
    assert around(last + 0.01, there) > 1.0  # also where the target is at its goal
    asked = 0.95 - scene[MID, RADIUS] - scene[TARGET, RADIUS]
    assert around(asked, far) == pytest.approx(0.0)
    assert around(asked + 0.02, far) == pytest.approx(WEIGHTS.around * 0.02)


def test_predictions_that_are_not_finite_cost_infinitely(scene):
    predicted = np.stack([[scene], [scene]])
    predicted[1, 0, TARGET, 0] = np.nan
    costs = total_cost(terms_of(scene, idle_pushes(2, 1), predicted, (0.5, 0.2)))
    assert np.isfinite(costs[0]) and costs[1] == np.inf


def test_the_distance_is_that_of_points_about_the_body(scene):
    wanted, bodies = Goal((BodyPose(0, 0.5, 0.1, 1.0),)), Bodies.named(("t", "disk"), ())

    def distance(x, y, heading):
        after = scene.copy()
        after[0, [0, 1, 2, RADIUS]] = x, y, heading, 0.06
        return pose_distance(problem_of(scene, wanted, bodies), after, 1.0)[0]

    assert distance(0.53, 0.14, 1.0) == pytest.approx(0.05)
    half = distance(0.5, 0.1, 1.0 + np.pi)
    assert half == pytest.approx(2 * 0.06)  # points on the circumscribed circle, opposite


def test_any_body_that_the_tool_may_not_touch_is_pushed_by_another(scene):
    roles = ("movable", "pushable")
    swapped, goal = Bodies.named(("disk", "disk"), roles), Goal.place(0.5, 0.2, body=0)
    pushes, after = idle_pushes(1, 1), scene[None, None]
    terms = terms_of(scene, pushes, after, (0.5, 0.2))
    problem = problem_of(scene[::-1], goal, swapped)
    mirrored = Objective(problem, WEIGHTS).terms(pushes, after[..., ::-1, :])
    for name in ("position", "distance", "alignment", "approach", "caution", "reach"):
        np.testing.assert_allclose(mirrored[name], terms[name], err_msg=name)


def offer(monkeypatch, function):
    """Let a package offer a cost term, and count it."""
    entry = EntryPoint("mine", "my_parts:mine", "sain.costs")
    monkeypatch.setattr(cost, "find_cost", lambda name: (entry, function))
    monkeypatch.setattr(cost, "further_terms", lambda more: [("mine", 1.0)])


@pytest.mark.parametrize(
    ("value", "moving", "text"),
    [
        (np.nan, True, "cost 'mine' of module my_parts: it is NaN for all 64 samples; it"),
        (np.inf, True, "it is NaN or infinite for all 64 samples; it must return finite numbers"),
        (np.nan, False, "it is NaN for doing nothing; it must return finite numbers"),
        ("a", False, "it returned <U1; it must be real numbers"),
        (None, False, "it returned object; it must be real numbers"),
        (1j, False, "it returned complex128; it must be real numbers"),
    ],
)
def test_a_cost_of_ones_own_that_is_no_finite_number_is_named(
    scene, dynamics, monkeypatch, value, moving, text
):
    def mine(rollout, objective):
        is_idle = not rollout.moving.any()
        return [value if is_idle == (not moving) else 0.0] * len(rollout.pushes)

    offer(monkeypatch, mine)
    objective = Objective(problem_of(scene, Goal.place(0.5, 0.25)), WEIGHTS)
    pushes = FEASIBILITY.limits.sample(generator(0), 64).reshape(64, 1, 5)
    predicted = dynamics.rollout(scene, pushes)
    with pytest.raises(ConfigError, match=text):
        objective.rest_cost()
        objective.terms(pushes, predicted)


def test_a_cost_of_ones_own_may_forbid_some_samples(scene, dynamics, monkeypatch):
    def mine(rollout, objective):
        return np.where(np.arange(len(rollout.pushes)) % 2, np.inf, 0.0)

    offer(monkeypatch, mine)
    pushes = FEASIBILITY.limits.sample(generator(0), 64).reshape(64, 1, 5)
    terms = terms_of(scene, pushes, dynamics.rollout(scene, pushes), (0.5, 0.25))
    assert np.isinf(total_cost(terms)).sum() == 32


def test_a_way_about_a_circle_is_straight_or_touches_it():
    """Past the circle it is a line; from side to side it is two tangents and an arc."""
    start = np.array([[[2.0, 0.0], [2.0, 3.0], [2.0, 0.0], [1.0, 0.0]]])
    end = np.array([[[2.0, 3.0], [-2.0, 3.0], [-2.0, 0.0], [-1.0, 0.0]]])
    arc = 2 * (np.sqrt(3.0) + np.pi / 6)
    ways = way_around(start, end, np.ones((1, 4)))
    np.testing.assert_allclose(ways, [[3.0, 4.0, arc, np.pi]])


def test_a_sequence_takes_as_long_as_its_strokes_ways_and_looks(scene, dynamics):
    """From the same side it takes less than from the other one; rests take nothing."""
    pushes = np.repeat(idle_pushes(1, 2), 3, axis=0)
    pushes[..., LENGTH], pushes[:, 1, LOCATION] = 0.05, (0.0, np.pi, 0.0)
    pushes[2, 1, LENGTH] = 0.0
    objective = Objective(problem_of(scene, Goal.place(0.5, 0.2)), WEIGHTS)
    predicted = dynamics.rollout(scene, pushes)
    rollout = Rollout.of(objective, pushes, predicted)
    same, other, one = duration(rollout, objective) - AGAIN * missed(rollout, objective)
    stroke = 0.05 / DEFAULT_SPEED + LOOK
    assert one == pytest.approx(stroke)
    assert 2 * stroke < same < 2 * stroke + 0.1 / TRAVEL_SPEED < other
    away = replace(objective.problem, tool=rollout.start[0, 0] + [-0.1, 0.0])
    late = Objective(away, WEIGHTS)
    behind = duration(Rollout.of(late, pushes, predicted), late) - AGAIN * missed(rollout, late)
    np.testing.assert_allclose(behind - [same, other, one], 0.1 / TRAVEL_SPEED)


def test_what_ends_within_its_tolerance_is_missed_by_less_than_one(scene):
    stay = scene[None, None]
    for off, share in ((0.0, 0.0), (0.005, 0.5), (0.01, 1.0), (0.2, 1.0)):
        place = scene[TARGET, POSITION] + [off, 0.0]
        objective = Objective(problem_of(scene, Goal.place(*place, tolerance=0.01)), WEIGHTS)
        rollout = Rollout.of(objective, idle_pushes(1, 1), stay)
        np.testing.assert_allclose(missed(rollout, objective), share)
