import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_core.feasibility import Feasibility, Reach, reachable
from sain_core.push import PushLimits, mirror_pushes
from sain_core.scene import POSITION, RADIUS, make_scene, mirror_scenes
from sain_core.types import Scene
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
    assert Feasibility(limits=LIMITS).assess(scene, push)[1] == pytest.approx(
        dense_gap(scene, push), abs=1e-6
    )


@given(seeds)
def test_feasibility_is_the_same_in_the_mirror(seed):
    scene = pair((0.6, 0.1))
    pushes = LIMITS.sample(np.random.default_rng(seed), 32)
    scenes = np.broadcast_to(scene, (32, *scene.shape))
    mirrored = Feasibility().mask(mirror_scenes(scenes), mirror_pushes(pushes))
    np.testing.assert_array_equal(mirrored, Feasibility().mask(scenes, pushes))


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
