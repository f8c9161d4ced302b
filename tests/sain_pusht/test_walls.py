"""Predictions that end beyond a wall end at it; all others stay as they are."""

import numpy as np

from sain_core.model import IdentityPrior
from sain_core.push import idle_pushes
from sain_pusht.agent import WALLS
from sain_pusht.block import pusht_bodies, scene_of
from sain_pusht.model import InsideWalls


def test_blocks_are_moved_straight_back_into_the_room() -> None:
    bodies, random = pusht_bodies(), np.random.default_rng(0)
    poses = np.column_stack([random.uniform(0, 512, (200, 2)), random.uniform(-3, 3, 200)])
    scenes = np.stack([scene_of(pose) for pose in poses])
    after = InsideWalls(IdentityPrior(), bodies).step(scenes, idle_pushes(200))
    low, high = WALLS
    inside = 0
    for before, moved in zip(scenes, after, strict=True):
        first, last = (bodies.shapes[0].placed(one[0]) for one in (before, moved))
        assert last.min() > low - 1e-9
        assert last.max() < high + 1e-9
        assert np.array_equal(before[0, 2:], moved[0, 2:])
        if first.min() >= low and first.max() <= high:
            assert np.array_equal(before, moved)
            inside += 1
    assert 20 < inside < 180
