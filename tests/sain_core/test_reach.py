"""Where the tool can stand: as a ring, and as a table of squares."""

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.feasibility import Reach, ReachTable
from sain_core.scene import unit

CELL = 0.01
RING = Reach()


def table_of(reach: Reach) -> ReachTable:
    """The squares that lie in another reach with all their corners."""
    line = np.arange(-0.8, 0.81, CELL)
    corners = reach.contains(np.stack(np.meshgrid(line, line), axis=-1))
    free = corners[1:, 1:] & corners[:-1, 1:] & corners[1:, :-1] & corners[:-1, :-1]
    return ReachTable.of((-0.8, -0.8), CELL, free)


TABLE = table_of(RING)


def test_a_table_of_a_ring_answers_as_the_ring_but_near_its_ends():
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (5000, 2))
    clear = np.abs(RING.room(points)) > 2 * CELL
    assert (TABLE.contains(points) <= RING.contains(points)).all()
    np.testing.assert_array_equal(TABLE.contains(points)[clear], RING.contains(points)[clear])
    ahead = (np.abs(RING.room(points)) < 0.15) & (points[:, 0] > 0.2)
    assert np.abs(TABLE.room(points) - RING.room(points))[ahead].max() < 2 * CELL


def test_a_way_is_covered_where_all_of_it_is_in_reach():
    random = np.random.default_rng(1)
    start = random.uniform(-0.9, 0.9, (2000, 2))
    way, length = unit(random.uniform(-np.pi, np.pi, 2000)), random.uniform(0.0, 0.15, 2000)
    shares = np.linspace(0.0, 1.0, 50)[:, None, None]
    inside = np.stack([TABLE.contains(p) for p in start + shares * (length[:, None] * way)])
    covered = TABLE.covers(start, way, length)
    assert (covered >= inside.all(axis=0)).all()
    assert np.mean(covered != inside.all(axis=0)) < 0.01


def test_outlines_enclose_the_squares():
    from shapely import Point, Polygon

    pieces = [Polygon(piece) for piece in TABLE.outlines]
    for point in np.random.default_rng(2).uniform(0.3, 0.7, (50, 2)):
        inside = any(piece.contains(Point(point)) for piece in pieces)
        assert inside == TABLE.contains(point)


def test_a_table_without_a_square_in_reach_is_refused():
    with pytest.raises(InvalidInputError, match="none of them in reach"):
        ReachTable.of((0.0, 0.0), CELL, np.zeros((3, 3), dtype=bool))


def test_a_table_crosses_the_wire_unchanged():
    from builtin_interfaces.msg import Time

    from sain_core.ros.codec import encode_reach
    from sain_core.wire import decode_reach

    message = encode_reach(TABLE, Time())
    back = decode_reach(message)
    np.testing.assert_array_equal(back.free, TABLE.free)
    assert back.corner == TABLE.corner
    assert back.cell == pytest.approx(TABLE.cell)
    message.info.width -= 1
    with pytest.raises(InvalidInputError, match=r"states 160 x 159 cells and has 25600"):
        decode_reach(message)
