"""Ways round the block keep off it and inside the walls."""

import numpy as np
import pytest

from sain_core.shapes.shape import distance_to_way
from sain_pusht.block import pusht_bodies, scene_of
from sain_pusht.motion import Room, path_round

ROOM = Room(0.022, 0.489)
GAP = 0.019


def outline_at(x: float, y: float, angle: float) -> np.ndarray:
    return pusht_bodies().shapes[0].placed(scene_of(np.array([x, y, angle]))[0])


def test_ways_keep_their_gap_and_stay_in_the_room() -> None:
    random, found = np.random.default_rng(0), 0
    for _ in range(60):
        outline = outline_at(*random.uniform(150, 350, 2), random.uniform(-3, 3))
        start, end = random.uniform(0.03, 0.48, (2, 2))
        ends = np.stack([start, end])
        corners = np.broadcast_to(outline, (2, *outline.shape))
        if distance_to_way(ends, ends, corners).min() < GAP:
            continue
        way = path_round(start, end, outline, GAP, ROOM)
        corners = np.broadcast_to(outline, (len(way) - 1, *outline.shape))
        assert distance_to_way(way[:-1], way[1:], corners).min() >= GAP - 1e-4
        assert ROOM.contains(way)
        assert np.array_equal(way[0], start)
        assert np.array_equal(way[-1], end)
        found += 1
    assert found > 20


def test_a_tool_that_touches_the_block_first_leaves_it() -> None:
    outline = outline_at(256, 256, 0.0)
    top = float(outline[:, 1].max())
    start = np.array([0.256, top + 0.015])
    way = path_round(start, np.array([0.256, 0.05]), outline, GAP, ROOM)
    assert way[1] == pytest.approx([0.256, top + GAP], abs=1e-9)
