"""judo's cylinder_push as a world: strokes lead the pusher where they should."""

import numpy as np
import pytest

pytest.importorskip("judo", reason="judo is optional: see benchmarks.cylinder_push")

from benchmarks.cylinder_planning import LIMITS, TEXTBOOK_TABLE, cylinder_agent
from benchmarks.cylinder_push import CylinderRecord, play_ours
from benchmarks.cylinder_world import (
    LEFT,
    SCALE,
    CylinderPace,
    CylinderWorld,
    stroke_times,
    travel_times,
)
from sain_core.push import LENGTH, LOCATION, make_push, strokes
from sain_core.scene import POSITION, unit
from sain_model.physics.planar import PlanarPrior


@pytest.fixture
def world() -> CylinderWorld:
    return CylinderWorld(LIMITS)


@pytest.mark.parametrize("location", [-2.0, 0.3, 3.0])
def test_the_way_to_a_stroke_touches_nothing_and_ends_there(world, location):
    before = world.reset(0)
    start, _ = strokes(before, make_push(location, 0.0, 0.1), LIMITS)
    world.follow(world.way_to(start / SCALE))
    np.testing.assert_allclose(world.task.data.qpos[:2], start / SCALE, atol=1e-3)
    np.testing.assert_allclose(world.scene, before, atol=1e-9)


def test_a_straight_stroke_takes_the_cart_along(world):
    before = world.reset(1)
    push = make_push(0.5, 0.0, 0.08)
    moved = (world.push(push) - before)[0, POSITION]
    expected = (push[LENGTH] - LIMITS.clearance) * unit(push[LOCATION])
    np.testing.assert_allclose(moved, expected, atol=1e-3)


@pytest.mark.parametrize("length", [0.002, 0.1, 2.5])
def test_strokes_and_ways_go_forward_and_end_in_time(length):
    pace, step = CylinderPace(), 0.02
    stroke = stroke_times(np.array([length, 0.0]), pace, step)
    way = travel_times(length, pace.free, pace.speeding, step)
    for travelled, fastest in ((stroke, pace.pushing), (way, pace.free)):
        steps = np.diff(travelled, prepend=0.0)
        assert (steps >= 0.0).all()
        assert steps.max() <= fastest * step + 1e-12
    assert length <= stroke[-1] <= length + LEFT
    assert way[-1] == length


def test_our_agent_brings_the_cart_to_the_goal(world):
    prior = PlanarPrior(TEXTBOOK_TABLE)
    record = play_ours(0, world, cylinder_agent(prior))
    assert record.reached(0.3)
    assert len(record.trace) == len(record.paused)


def test_time_counts_from_when_the_cart_stays():
    trace = np.array([0.5, 0.005, 0.5, 0.005, 0.005])
    record = CylinderRecord(trace, np.ones(2), np.array([0.0, 1.0, 1.0, 2.0, 2.0]))
    assert record.reached(0.01)
    assert record.time_to(0.01, 0.02) == pytest.approx(4 * 0.02 + 2.0)
