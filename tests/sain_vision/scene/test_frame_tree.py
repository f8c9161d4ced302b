"""Poses of frames: chains of transforms, and trees that are none."""

from math import cos, inf, pi, sin

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_vision.scene.frame_tree import FrameTree

NO_TURN = (0.0, 0.0, 0.0, 1.0)


def about(axis: int, angle: float) -> tuple[float, float, float, float]:
    turn = [0.0, 0.0, 0.0, cos(angle / 2)]
    turn[axis] = sin(angle / 2)
    return tuple(turn)  # type: ignore[return-value]


def test_a_camera_that_looks_down_is_taken_into_account():
    """It hangs 1 m above (0.5, 0): its x axis along the world's, its z axis down."""
    tree = FrameTree("world")
    tree.take("world", "camera", (0.5, 0.0, 1.0), about(0, pi), inf)
    flipped = np.array(about(0, pi))  # the tag's z axis points up, to the camera
    tree.take("camera", "tag", (0.1, 0.2, 0.98), flipped.tolist(), 7.0)
    pose, stamp = tree.pose("tag")
    np.testing.assert_allclose(pose, (0.6, -0.2, 0.0), atol=1e-12)
    assert stamp == 7.0


def test_chains_agree_with_matrices():
    random = np.random.default_rng(1)
    tree, place, heading = FrameTree("world"), np.zeros(2), 0.0
    parent = "world"
    for number in range(4):
        x, y, angle = random.uniform(-1, 1, 3)
        tree.take(parent, f"f{number}", (x, y, 0.0), about(2, angle), 1.0)
        place = place + np.array(
            [cos(heading) * x - sin(heading) * y, sin(heading) * x + cos(heading) * y]
        )
        heading, parent = heading + angle, f"f{number}"
    np.testing.assert_allclose(tree.pose("f3")[0], (*place, heading), atol=1e-12)


@pytest.mark.parametrize(
    ("links", "message"),
    [
        ([], "frame 'tag' was never seen on /tf; it must be connected with 'world'"),
        ([("map", "tag", NO_TURN, 1.0)], "frame 'tag' ends at 'map'"),
        ([("tag", "a", NO_TURN, 1.0), ("a", "tag", NO_TURN, 1.0)], "in a circle of frames"),
        (
            [("world", "tag", NO_TURN, 1.0), ("map", "tag", NO_TURN, 1.1)],
            "frame 'tag' has two parents, 'world' and 'map'; stop one",
        ),
        ([("world", "tag", about(0, 1.0), 1.0)], "frame 'tag' is tilted by 57 degrees"),
    ],
)
def test_trees_that_are_none(links, message):
    tree = FrameTree("world")
    for parent, child, turn, stamp in links:
        tree.take(parent, child, (0.0, 0.0, 0.0), turn, stamp)
    with pytest.raises(InvalidInputError, match=message):
        tree.pose("tag")


@pytest.mark.parametrize(
    ("turn", "message"),
    [
        ((0.0, 0.0, 0.0, 0.0), "quaternion of length 0; it must be 1"),
        ((0.0, float("nan"), 0.0, 1.0), "has a number that is NaN or Inf"),
    ],
)
def test_what_is_no_pose_is_refused(turn, message):
    with pytest.raises(InvalidInputError, match=f"frame 'tag' .*{message}"):
        FrameTree("world").take("world", "tag", (0.0, 0.0, 0.0), turn, 1.0)
