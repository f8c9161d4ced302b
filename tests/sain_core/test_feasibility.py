import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st

from sain_core.errors import InvalidInputError
from sain_core.feasibility import Feasibility, Reach, ReachTable, reachable
from sain_core.push import PushLimits
from sain_core.ros.codec import encode_reach
from sain_core.scene import POSITION, RADIUS, make_scene, unit
from sain_core.types import Scene
from sain_core.wire import decode_reach
from tests.strokes import tool_end, tool_start

LIMITS = PushLimits()
seeds = st.integers(0, 2**32 - 1)


def pair(target: tuple[float, float] = (0.64, 0.0)) -> Scene:
    return make_scene(np.array([(0.5, 0.0), target]), np.full(2, 8.0), np.array([0.08, 0.06]))


def dense_gap(scene: Scene, push: np.ndarray) -> float:
    """The same gap, found by looking at many places on the way."""
    start, end = tool_start(scene, push, LIMITS), tool_end(scene, push, LIMITS)
    places = start + np.linspace(0, 1, 2001)[:, None] * (end - start)
    apart = np.linalg.norm(places[:, None] - scene[None, 1:, POSITION], axis=-1)
    return float((apart - scene[1:, RADIUS]).min() - LIMITS.tool_radius)


@given(seeds)
def test_the_gap_is_the_smallest_on_the_way(seed):
    scene, push = pair(), LIMITS.sample(np.random.default_rng(seed), 1)[0]
    assert Feasibility(limits=LIMITS).assess(scene, push).gaps == pytest.approx(
        dense_gap(scene, push), abs=1e-6
    )


@given(seeds)
def test_a_reachable_way_is_in_reach_at_every_place(seed):
    reach = Reach(inner=0.42, outer=0.62)
    scene, pushes = pair(), LIMITS.sample(np.random.default_rng(seed), 64)
    scenes = np.broadcast_to(scene, (64, *scene.shape))
    start, end = tool_start(scenes, pushes, LIMITS), tool_end(scenes, pushes, LIMITS)
    steps = np.linspace(0, 1, 101)[:, None, None]
    ways = start + steps * (end - start)
    inside = reach.contains(ways).all(axis=0)
    allowed = reachable(scenes, pushes, LIMITS, reach)
    assert not (allowed & ~inside).any()
    assert (allowed == inside).mean() > 0.9  # and is not refused without a reason


CELL = 0.01
RING = Reach()


TABLE = RING.table


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


def test_a_table_without_a_square_in_reach_is_refused():
    with pytest.raises(InvalidInputError, match="none of them in reach"):
        ReachTable.of((0.0, 0.0), CELL, np.zeros((3, 3), dtype=bool))


def test_a_table_crosses_the_wire_unchanged():
    message = encode_reach(TABLE, Time())
    back = decode_reach(message)
    np.testing.assert_array_equal(back.free, TABLE.free)
    assert back.corner == TABLE.corner
    assert back.cell == pytest.approx(TABLE.cell)
    message.info.width -= 1
    with pytest.raises(InvalidInputError, match=r"states 200 x 199 cells and has 40000"):
        decode_reach(message)
