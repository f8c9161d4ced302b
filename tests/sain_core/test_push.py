from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_core.errors import InvalidInputError, OutOfRangeError
from sain_core.push import (
    LENGTH,
    PUSH_NAMES,
    PUSH_SIZE,
    PushLimits,
    idle_pushes,
    make_push,
    mirror_pushes,
    push_direction,
)
from sain_core.scene import MID, POSITION, RADIUS, make_scene, mirror_scenes, unit
from tests.strokes import rotate_pushes, rotate_scenes, tool_end, tool_start

LIMITS = PushLimits()
angles = st.floats(-pi, pi)
seeds = st.integers(0, 2**32 - 1)


def draw(seed: int, count: int = 64) -> np.ndarray:
    return LIMITS.sample(np.random.default_rng(seed), count)


@given(seeds)
def test_every_sampled_push_is_inside_the_limits(seed):
    for push in draw(seed):
        LIMITS.check(push)


@pytest.mark.parametrize(
    ("push", "message"),
    [
        ((-pi, 0.0, 0.1), r"push location is -3.1416 rad; allowed: \(-pi, pi\]"),
        ((3.2, 0.0, 0.1), "push location is 3.2000 rad"),
        ((0.0, 0.79, 0.1), "push angle is 0.7900 rad; allowed: "),
        ((0.0, 0.0, -0.01), r"push length is -0.0100 m; allowed: \[0, 0.15\] m"),
        ((0.0, 0.0, 0.151), "push length is 0.1510 m"),
        ((0.0, 0.0, 0.1, 0.009), r"push speed is 0.0090 m/s; allowed: \[0.01, 0.5\] m/s"),
        ((0.0, 0.0, 0.1, 0.51), "push speed is 0.5100 m/s"),
        ((0.0, 0.0, 0.1, 0.2, 1), "the push is against body 1, which is movable"),
        ((0.0, 0.0, 0.1, 0.2, 0.5), "the push is against body 0.5, which does not exist"),
    ],
)
def test_a_push_out_of_range_is_refused(push, message):
    location, angle, length, speed, body = (*push, *(0.2, 0)[len(push) - 3 :])
    with pytest.raises((OutOfRangeError, InvalidInputError), match=message):
        LIMITS.check(make_push(location, angle, length, speed=speed, body=body))


@given(seeds)
def test_the_tool_travels_the_push_s_length_in_its_direction(seed):
    pushes = draw(seed)
    scene = make_scene(np.array([(0.4, 0.1), (0.6, 0.0)]), np.full(2, 8.0), np.full(2, 0.06))
    scenes = np.broadcast_to(scene, (len(pushes), *scene.shape))
    start, end = tool_start(scenes, pushes, LIMITS), tool_end(scenes, pushes, LIMITS)
    np.testing.assert_allclose(
        end - start, pushes[:, LENGTH, None] * unit(push_direction(pushes)), atol=1e-12
    )
    gap = np.linalg.norm(scenes[:, MID, POSITION] - start, axis=-1) - scenes[:, MID, RADIUS]
    np.testing.assert_allclose(gap, LIMITS.tool_radius + LIMITS.clearance)


@given(seeds, angles)
def test_the_tool_s_way_turns_and_mirrors_with_the_scene(seed, angle):
    scene = make_scene(np.array([(0.4, 0.1), (0.6, 0.0)]), np.full(2, 8.0), np.full(2, 0.06))
    push = draw(seed, 1)[0]
    end = tool_end(scene, push, LIMITS)
    turned = tool_end(rotate_scenes(scene, angle), rotate_pushes(push, angle), LIMITS)
    cos, sin = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(turned, np.array([[cos, -sin], [sin, cos]]) @ end, atol=1e-9)
    mirrored = tool_end(mirror_scenes(scene), mirror_pushes(push), LIMITS)
    np.testing.assert_allclose(mirrored, end * (1, -1), atol=1e-12)


@pytest.mark.parametrize("column", range(PUSH_SIZE))
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nan_and_inf_are_refused_by_name(column, value):
    push = idle_pushes()
    push[column] = value
    with pytest.raises(InvalidInputError, match=f"{PUSH_NAMES[column]} of the push is {value}"):
        LIMITS.check(push)
