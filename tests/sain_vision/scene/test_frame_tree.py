"""Poses of frames: chains of transforms, and trees that are none."""

from math import cos, inf, pi, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sain_core.errors import InvalidInputError
from sain_vision.scene.frame_tree import FrameTree

NO_TURN = (0.0, 0.0, 0.0, 1.0)


def about(axis: int, angle: float) -> tuple[float, float, float, float]:
    turn = [0.0, 0.0, 0.0, cos(angle / 2)]
    turn[axis] = sin(angle / 2)
    return tuple(turn)  # type: ignore[return-value]


def test_chains_agree_with_matrices():
    """Also where a camera looks down: its z axis down, and that of a tag up again."""
    random = np.random.default_rng(1)
    tree, whole, parent = FrameTree("world"), np.eye(4), "world"
    for number, axis in enumerate((2, 2, 0, 2, 0, 2)):
        angle = pi if axis == 0 else random.uniform(-1, 1)
        step = np.eye(4)
        step[:3, :3] = Rotation.from_quat(about(axis, angle)).as_matrix()
        step[:3, 3] = random.uniform(-1, 1, 3)
        stamp = inf if number < 2 else float(10 - number)
        tree.take(parent, f"f{number}", step[:3, 3].tolist(), about(axis, angle), stamp)
        whole, parent = whole @ step, f"f{number}"
    pose, stamp = tree.pose("f5")
    heading = np.arctan2(whole[1, 0], whole[0, 0])
    np.testing.assert_allclose(pose, (*whole[:2, 3], heading), atol=1e-12)
    assert stamp == 5.0  # the oldest


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
        ([("world", "tag", (0.0,) * 4, 1.0)], "frame 'tag' .* quaternion of length 0; it must be"),
        ([("world", "tag", (inf,) * 4, 1.0)], "frame 'tag' .*has a number that is NaN or Inf"),
    ],
)
def test_trees_that_are_none(links, message):
    tree = FrameTree("world")
    with pytest.raises(InvalidInputError, match=message):
        for parent, child, turn, stamp in links:
            tree.take(parent, child, (0.0, 0.0, 0.0), turn, stamp)
        tree.pose("tag")
