"""Goals that cannot be, and the nearest that can."""

import re
from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import InvalidInputError, OffTableError, SainError, UnreachableError
from sain_core.goal import BodyPose, Goal
from sain_core.push import SPEED, make_push
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_mppi.objective.problem import Problem

BODIES = Bodies.named(("t", "disk", "disk"), ("pushable", "pushable", "fixed"))
SCENE = make_scene(
    np.array([(0.45, 0.0), (0.5, 0.25), (0.6, -0.25)]), np.full(3, 1.0), np.full(3, 0.06)
)


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


def goal(*places, keep=(), body=0):
    heading = (0.5, None)
    poses = (BodyPose(body + n, *place, heading[body + n]) for n, place in enumerate(places))
    return Goal(tuple(poses), keep)


@pytest.mark.parametrize(
    ("wanted", "kind", "farthest"),
    [
        (goal((1.3, 0.0)), OffTableError, 0.46),
        (goal((600.0, 100.0)), OffTableError, 700.0),
        (goal((1.05, 0.1)), UnreachableError, 0.22),
        (goal((0.50, 0.132), keep=(0,), body=1), None, 0.0),
        (goal((0.60, -0.14), body=1), InvalidInputError, 0.011),  # 10 mm in a fixed disk
        (goal((0.52, 0.2), keep=(1,)), InvalidInputError, 0.04),
        (goal((0.5, 0.0), (0.5, 0.05)), InvalidInputError, 0.08),
        (goal((1.0, 0.0), (1.0, 0.05)), InvalidInputError, 0.18),
        (goal((0.52, 0.24)), None, 0.0),  # where another body stands that may be pushed away
    ],
)
def test_a_goal_that_cannot_be_is_refused_with_the_nearest_that_can(wanted, kind, farthest):
    if kind is None:
        Problem.of(SCENE, wanted, BODIES)
        return
    with pytest.raises(kind, match="the nearest that is possible is") as caught:
        Problem.of(SCENE, wanted, BODIES)
    nearest = named(wanted, caught.value)
    Problem.of(SCENE, nearest, BODIES)
    ways = nearest.places - wanted.places
    length = np.hypot(*ways.T).max()
    assert 0.0 < length < farthest
    for left in (0.004, length / 2):  # [m], of the way to it
        with pytest.raises(SainError):
            Problem.of(SCENE, moved(wanted, nearest.places - left / length * ways), BODIES)


def named(wanted, error):
    """Return a goal with the places that an error names."""
    text = str(error).split("possible is")[1]
    places = wanted.places
    for x, y, body in re.findall(r"\(([-.\d]+), ([-.\d]+)\) m of body (\d)", text):
        places[wanted.wanted.index(int(body))] = float(x), float(y)
    return moved(wanted, places)


def moved(wanted, places):
    pairs = zip(wanted.poses, places.tolist(), strict=True)
    return replace(wanted, poses=tuple(replace(pose, x=x, y=y) for pose, (x, y) in pairs))


def test_what_no_place_helps_names_none():
    with pytest.raises(InvalidInputError, match=r"body 2 is fixed; it cannot be moved to a goal$"):
        Problem.of(SCENE, Goal((BodyPose(2, 0.5, 0.0),)), BODIES)


def test_a_push_that_was_refused_may_be_tried_again_much_slower(scene):
    """The joints of an arm may have been too slow for it."""
    problem = Problem.of(scene, Goal.place(0.7, 0.05))
    tried = np.stack([make_push(0.0, 0.0, 0.1)] * 3)
    tried[:, SPEED] = 0.4, 0.35, 0.2
    assert problem.permitted(tried).all()
    refused = replace(problem, refused=(tried[0],))
    assert refused.permitted(tried).tolist() == [False, False, True]
