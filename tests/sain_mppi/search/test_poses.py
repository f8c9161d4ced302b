from math import pi

import numpy as np
import pytest

from sain_core.errors import InvalidInputError, OffTableError, OutOfRangeError, SainError
from sain_core.scene import Table, make_scene
from sain_core.shapes.bodies import Bodies
from sain_mppi.search.pose_costs import pose_distance
from sain_mppi.search.poses import BodyPose, PoseGoal

BODIES = Bodies.named(
    ("t", "box_2x1", "disk", "square"), ("pushable", "pushable", "pushable", "fixed")
)
SCENE = make_scene(
    np.array([[0.4, -0.2], [0.5, 0.0], [0.4, 0.2], [0.6, 0.25]]),
    np.full(4, 8.0),
    np.full(4, 0.06),
    np.array([0.1, 0.2, 0.0, 0.0]),
)


def goal(*poses: BodyPose, keep: tuple[int, ...] = ()) -> PoseGoal:
    return PoseGoal(poses, keep)


def moved(body: int, x: float, y: float, heading: float) -> np.ndarray:
    scene = SCENE.copy()
    scene[body, :3] = x, y, heading
    return scene


@pytest.mark.parametrize(
    ("wanted", "kind", "message"),
    [
        (goal(), InvalidInputError, "the goal has no poses"),
        (goal(BodyPose(0, 0.6, 0.25)), InvalidInputError, "body 0 overlaps fixed body 3 by"),
        (
            goal(BodyPose(0, 0.5, 0.0), BodyPose(1, 0.5, 0.0)),
            InvalidInputError,
            "body 1 overlaps goal of body 0 by",
        ),
        (
            goal(BodyPose(0, 0.41, 0.19), keep=(2,)),
            InvalidInputError,
            "body 0 overlaps kept body 2 by",
        ),
        (goal(BodyPose(4, 0.5, 0.0)), InvalidInputError, "body 4; the scene has bodies 0 to 3"),
        (goal(BodyPose(0, 0.5, 0.0), BodyPose(0, 0.6, 0.0)), InvalidInputError, "0 has 2 goals"),
        (goal(BodyPose(2, 0.5, 0.0, 0.3)), InvalidInputError, "heading 0.300 rad; it is a disk"),
        (goal(BodyPose(3, 0.5, 0.0)), InvalidInputError, "body 3 is fixed; it cannot be moved"),
        (goal(BodyPose(0, 1.5, 0.0)), OffTableError, r"\(1.500, 0.000\) m of body 0 is off"),
        (
            goal(BodyPose(0, 0.6, 0.25, 0.0)),
            InvalidInputError,
            "the goal of body 0 overlaps fixed body 3 by .* mm",
        ),
        (
            goal(BodyPose(0, 0.5, 0.0, 0.0), BodyPose(1, 0.5, 0.02, 0.0)),
            InvalidInputError,
            "the goal of body 1 overlaps goal of body 0 by .* mm",
        ),
        (goal(BodyPose(0, 0.5, 0.0), keep=(0,)), InvalidInputError, "body 0 is to be kept and to"),
        (goal(BodyPose(0, 0.5, 0.0), keep=(7,)), InvalidInputError, "body 7 is to be kept"),
    ],
)
def test_a_goal_that_cannot_be_is_refused_by_body_and_value(wanted, kind, message):
    with pytest.raises(kind, match=message):
        wanted.check(SCENE, BODIES, Table())


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({"x": np.nan}, InvalidInputError),
        ({"heading": np.inf}, InvalidInputError),
        ({"tolerance": 0.0}, OutOfRangeError),
        ({"heading_tolerance": -0.1}, OutOfRangeError),
    ],
)
def test_numbers_that_are_none_are_refused(values, kind):
    with pytest.raises(SainError) as caught:
        BodyPose(**{"body": 2, "x": 0.5, "y": 0.0, **values})
    assert isinstance(caught.value, kind) and next(iter(values)) in str(caught.value)


@pytest.mark.parametrize("tolerance", [-0.01, 0.0, 2.0, float("nan")])
def test_a_kept_body_has_a_positive_tolerance_below_a_metre(tolerance: float):
    with pytest.raises(OutOfRangeError, match=f"keep_tolerance is {tolerance}"):
        PoseGoal((BodyPose(0, 0.5, 0.0),), (1,), tolerance)


def test_a_goal_without_heading_beside_another_body_is_allowed():
    # The T's inscribed circle is apart from the square, though its circumscribed one is not.
    goal(BodyPose(0, 0.52, 0.25)).check(SCENE, BODIES, Table())


def test_a_heading_counts_modulo_the_symmetry():
    box = goal(BodyPose(1, 0.5, 0.1, 0.0))
    for heading, expected in ((0.05, 0.05), (pi + 0.05, 0.05), (-pi + 0.05, 0.05), (1.0, 1.0)):
        _, turns = box.errors(moved(1, 0.5, 0.1, heading), BODIES)
        assert turns[0] == pytest.approx(expected)
    t = goal(BodyPose(0, 0.5, 0.1, 0.0))
    assert abs(t.errors(moved(0, 0.5, 0.1, pi - 0.01), BODIES)[1][0]) == pytest.approx(pi - 0.01)


def test_a_goal_is_reached_when_place_heading_and_rest_agree():
    wanted = goal(BodyPose(0, 0.5, 0.1, 1.0, 0.02, 0.1), keep=(1,))
    there = moved(0, 0.515, 0.1, 1.09)
    assert wanted.reached(there, SCENE, BODIES)
    assert not wanted.reached(moved(0, 0.521, 0.1, 1.0), SCENE, BODIES)
    assert not wanted.reached(moved(0, 0.5, 0.1, 1.11), SCENE, BODIES)
    sliding = there.copy()
    sliding[2, 3] = 0.01  # m/s, another body
    assert not wanted.reached(sliding, SCENE, BODIES)
    pushed = there.copy()
    pushed[1, 0] += 0.006
    assert not wanted.reached(pushed, SCENE, BODIES) and wanted.moved(pushed, SCENE) == 1


def test_the_distance_is_that_of_points_about_the_body():
    wanted = goal(BodyPose(0, 0.5, 0.1, 1.0))
    assert pose_distance(wanted, moved(0, 0.53, 0.14, 1.0), BODIES, 1.0)[0] == pytest.approx(0.05)
    half = pose_distance(wanted, moved(0, 0.5, 0.1, 1.0 + pi), BODIES, 1.0)[0]
    assert half == pytest.approx(2 * 0.06)  # points on the circumscribed circle, opposite
