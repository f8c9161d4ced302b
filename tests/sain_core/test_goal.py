# ruff: noqa: E501 - a case is a line
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from sain_core.errors import InvalidInputError, OffTableError, OutOfRangeError, SainError
from sain_core.goal import BodyPose, Goal
from sain_core.scene import Table, make_scene
from sain_core.shapes.bodies import Bodies
from tests.strokes import rotate_scenes

BODIES = Bodies.named(
    ("t", "box_2x1", "disk", "square"), ("pushable", "pushable", "pushable", "fixed")
)
SCENE = make_scene(
    np.array([[0.4, -0.2], [0.5, 0.0], [0.4, 0.2], [0.6, 0.25]]),
    np.full(4, 8.0),
    np.full(4, 0.06),
    np.array([0.1, 0.2, 0.0, 0.0]),
)


def goal(*poses: BodyPose, keep: tuple[int, ...] = ()) -> Goal:
    return Goal(poses, keep)


def moved(body: int, x: float, y: float, heading: float) -> np.ndarray:
    scene = SCENE.copy()
    scene[body, :3] = x, y, heading
    return scene


@pytest.mark.parametrize(
    ("wanted", "kind", "message"),
    [
        (goal(BodyPose(0, 0.5, 0.0), BodyPose(1, 0.5, 0.0)), InvalidInputError, "body 1 overlaps goal of body 0 by"),
        (goal(BodyPose(0, 0.41, 0.19), keep=(2,)), InvalidInputError, "body 0 overlaps kept body 2 by"),
        (goal(BodyPose(4, 0.5, 0.0)), InvalidInputError, "body 4; the scene has bodies 0 to 3"),
        (goal(BodyPose(0, 0.5, 0.0), BodyPose(0, 0.6, 0.0)), InvalidInputError, "0 has 2 goals"),
        (goal(BodyPose(2, 0.5, 0.0, 0.3)), InvalidInputError, "heading 0.300 rad; it is a disk"),
        (goal(BodyPose(3, 0.5, 0.0)), InvalidInputError, "body 3 is fixed; it cannot be moved"),
        (goal(BodyPose(0, 1.5, 0.0)), OffTableError, r"\(1.500, 0.000\) m .* off .* 0.6\] m$"),
        (goal(BodyPose(0, 600.0, 100.0)), OffTableError, r"0.6\] m; in mm\? 0.6 0.1 m$"),
        (goal(BodyPose(0, 0.6, 0.25, 0.0)), InvalidInputError, "the goal of body 0 overlaps fixed body 3 by .* mm"),
        (goal(BodyPose(0, 0.5, 0.0), keep=(0,)), InvalidInputError, "body 0 is to be kept and to"),
        (goal(BodyPose(0, 0.5, 0.0), keep=(7,)), InvalidInputError, "body 7 is to be kept"),
    ],
)  # fmt: skip
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


def test_a_heading_counts_modulo_the_symmetry():
    box = goal(BodyPose(1, 0.5, 0.1, 0.0))
    for heading, expected in ((0.05, 0.05), (pi + 0.05, 0.05), (-pi + 0.05, 0.05), (1.0, 1.0)):
        _, turns = box.errors(moved(1, 0.5, 0.1, heading), BODIES)
        assert turns[0] == pytest.approx(expected)
    t = goal(BodyPose(0, 0.5, 0.1, 0.0))
    assert abs(t.errors(moved(0, 0.5, 0.1, pi - 0.01), BODIES)[1][0]) == pytest.approx(pi - 0.01)


@pytest.mark.parametrize("seed", range(10))
def test_turning_and_moving_scene_and_goal_together_changes_no_judgement(seed):
    random = np.random.default_rng(seed)
    wanted = goal(
        BodyPose(0, *random.uniform(0.3, 0.6, 2), random.uniform(-pi, pi), 0.05, 0.5),
        BodyPose(1, *random.uniform(0.3, 0.6, 2), random.uniform(-pi, pi)),
        BodyPose(2, *random.uniform(0.3, 0.6, 2)),
        keep=(3,),
    )
    after = wanted.placed(SCENE)
    after[:, :3] += random.normal(0.0, [0.005, 0.005, 0.02], (4, 3))
    angle, way = random.uniform(-pi, pi), random.uniform(-0.1, 0.1, 2)

    def carried(scene: np.ndarray) -> np.ndarray:
        scene = rotate_scenes(scene, angle)
        scene[:, :2] += way
        return scene

    there = carried(wanted.placed(SCENE))
    poses = tuple(
        replace(
            pose,
            x=there[pose.body, 0],
            y=there[pose.body, 1],
            heading=None if pose.heading is None else there[pose.body, 2],
        )
        for pose in wanted.poses
    )
    table = Table(-2.0, 2.0, -2.0, 2.0)
    one = wanted.judge(after, SCENE, BODIES, table)
    other = replace(wanted, poses=poses).judge(carried(after), carried(SCENE), BODIES, table)
    for name in ("distances", "turns", "ways"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-12)
    assert (one.missed, one.moved(), one.reached) == (other.missed, other.moved(), other.reached)


@pytest.mark.parametrize("seed", range(10))
def test_a_goal_is_reached_if_and_only_if_all_errors_are_within_their_tolerances(seed):
    random = np.random.default_rng(seed)
    wanted = goal(
        BodyPose(0, 0.5, 0.1, 1.0, *random.uniform(0.01, 0.05, 2)),
        BodyPose(2, 0.4, -0.3, tolerance=random.uniform(0.01, 0.05)),
        keep=(1,),
    )
    after = wanted.placed(SCENE)
    after[:3, :3] += random.normal(0.0, [0.006, 0.006, 0.02], (3, 3))
    after[1, :2] = SCENE[1, :2] + random.normal(0.0, 0.003, 2)
    first, second = wanted.poses
    expected = (
        np.hypot(*after[0, :2] - [0.5, 0.1]) <= first.tolerance
        and abs(after[0, 2] - 1.0) <= first.heading_tolerance
        and np.hypot(*after[2, :2] - [0.4, -0.3]) <= second.tolerance
        and np.hypot(*(after - SCENE)[1, :2]) <= wanted.keep_tolerance
    )
    judged = wanted.judge(after, SCENE, BODIES)
    assert judged.reached == expected
    assert (judged.missed == () and judged.moved() is None) == expected
