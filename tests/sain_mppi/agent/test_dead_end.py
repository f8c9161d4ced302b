"""Why pushes bring a body no nearer: one scene for each cause."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.feasibility import Feasibility, Reach
from sain_core.goal import BodyPose, Goal
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_mppi.agent.dead_end import Cause, Way, find_dead_end
from sain_mppi.objective.problem import Problem


def problem(target, goal, *others, shape="t"):
    """A T to be pushed from a place to another one, and other bodies about it."""
    places = np.array([target, *others])
    count = len(places)
    scene = make_scene(places, np.ones(count), np.full(count, 0.05))
    bodies = Bodies.named([shape] + ["disk"] * len(others), ["pushable"] + ["fixed"] * len(others))
    pose = BodyPose(0, *goal, None, 0.005)
    return Problem(scene, Goal((pose,)), bodies, scene, Feasibility())


FREE = problem((0.45, 0.0), (0.55, 0.0))
CASES = [
    (problem((0.72, 0.0), (0.6, 0.0)), {}, Cause.REACH, "out of the arm's reach"),
    (
        problem((0.4, 0.0), (0.62, 0.0), (0.51, 0.02)),
        {},
        Cause.BLOCKED,
        "body 1 is in the way; move it",
    ),
    (
        replace(FREE, shortest=0.2),
        {},
        Cause.NOISE,
        "100 mm are left, and noise hides ways below 200 mm",
    ),
    (FREE, {"error": np.array([0.15])}, Cause.MODEL, "and predictions err by 150 mm"),
    (FREE, {"error": np.array([0.01])}, Cause.UNEXPLAINED, "move a body, or choose another goal"),
]


@pytest.mark.parametrize(("where", "figures", "cause", "words"), CASES)
def test_the_cause_is_found_and_says_what_to_do(where, figures, cause, words):
    found = find_dead_end(where, 3, **figures)
    assert (found.cause, found.body) == (cause, 0)
    assert str(found).startswith("3 pushes brought body 0 no nearer: ")
    assert words in str(found)


def test_a_side_that_no_push_reaches_is_named():
    disk = problem((0.45, 0.0), (0.55, 0.0), shape="disk")
    x = float(Way.of(disk).stand[0])
    short = replace(disk, feasibility=Feasibility(reach=Reach(outer=x + 0.005)))
    found = find_dead_end(short, 3)
    assert found.cause == Cause.SIDE
    assert "no permitted push moves body 0 where it has to go" in str(found)


def test_no_room_on_the_table_behind_a_body_is_named():
    places = np.array([[0.258, 0.146], [0.312, 0.278]])
    scene = make_scene(places, np.full(2, 8.0), np.array([0.08, 0.06]))
    found = find_dead_end(Problem.of(scene, Goal.place(0.321, 0.280, 0.005)), 3)
    assert found.cause == Cause.ROOM
    assert "the table has no room for body 0 behind body 1" in str(found)
