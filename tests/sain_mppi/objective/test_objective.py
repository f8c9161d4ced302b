import numpy as np
import pytest

from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.push import ANGLE, BODY, LENGTH, idle_pushes, strokes
from sain_core.scene import POSITION, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_mppi.config import CostWeights
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.problem import Problem
from sain_mppi.objective.proposals import candidates, uniform

FEASIBILITY = Feasibility()
PAIR = Bodies.named(("bar", "disk"), ("pushable", "pushable"))
SCENE = make_scene(
    np.array([[0.45, -0.15], [0.5, 0.15]]), np.full(2, 8.0), np.full(2, 0.06), np.array([0.4, 0.0])
)
GOAL = Goal((BodyPose(0, 0.6, -0.1, 0.0), BodyPose(1, 0.35, 0.2)))


def objective(bodies: Bodies = PAIR, goal: Goal = GOAL, scene: Scene = SCENE) -> Objective:
    return Objective(Problem(scene, goal, bodies, scene, FEASIBILITY), CostWeights())


def test_uniform_draws_are_even_along_all_outlines_together():
    drawn = uniform(objective(), np.random.default_rng(0), 4000, 2)
    assert drawn.shape == (4000, 2, 5)
    share = (drawn[..., BODY] == 1).mean()  # a bar of 5 x 1 has a perimeter of 4.71 radii
    assert share == pytest.approx(2 * np.pi / (2 * np.pi + 4.71), abs=0.02)


def test_candidates_travel_towards_the_pose_of_their_body():
    drawn = candidates(objective(), np.random.default_rng(0), 300, 1)[:, 0]
    assert {0.0, 1.0} == set(drawn[:, BODY])
    scenes = np.broadcast_to(SCENE, (300, 2, 8))
    _, headings = strokes(scenes, drawn, FEASIBILITY.limits, PAIR)
    body = drawn[:, BODY].astype(int)
    way = np.array([[0.6, -0.1], [0.35, 0.2]])[body] - SCENE[body, POSITION]
    apart = np.abs(wrap_angle(headings - np.arctan2(way[:, 1], way[:, 0])))
    assert np.median(apart) < 0.05
    assert (drawn[:, LENGTH] <= FEASIBILITY.limits.max_length).all()
    assert (np.abs(drawn[:, ANGLE]) <= FEASIBILITY.limits.max_angle).all()


def test_moving_a_body_that_is_to_be_kept_costs():
    kept = Goal((BodyPose(0, 0.6, -0.1, 0.0),), keep=(1,))
    after = SCENE.copy()
    after[1, 0] += 0.02
    terms = objective(goal=kept).terms(idle_pushes(1, 1), after[None, None])
    assert terms["keep"][0] == pytest.approx(CostWeights().keep * 0.02)


@pytest.mark.parametrize(("x", "out"), [(0.4, 0.0), (0.22, 0.02), (0.18, 0.06)])
def test_a_shape_that_gets_over_the_edge_of_the_table_costs(x, out):
    after = SCENE.copy()
    after[0, POSITION] = x, 0.0  # a circle of 6 cm and 2 cm of room; the edge is at 16 cm
    after[1, POSITION] = 0.5, 0.3
    for goal in (GOAL, Goal.place(0.4, 0.0)):
        terms = objective(goal=goal).terms(idle_pushes(1, 1), after[None, None])
        assert terms["overhang"][0] == pytest.approx(CostWeights().overhang * out)
