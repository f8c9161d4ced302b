from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_core.errors import InvalidInputError
from sain_core.scene import (
    MASS,
    OMEGA,
    RADIUS,
    THETA,
    VX,
    VY,
    X,
    is_settled,
    make_scene,
    mirror_scenes,
    surface_gaps,
    unit,
    wrap_angle,
)
from sain_core.shapes.bodies import check_bodies
from sain_core.types import Scene
from tests.strokes import rotate_scenes

angles = st.floats(-50.0, 50.0)
seeds = st.integers(0, 2**32 - 1)


def random_scene(seed: int, disks: int = 3) -> Scene:
    random = np.random.default_rng(seed)
    positions = np.stack([0.3 + 0.2 * np.arange(disks), random.uniform(-0.4, 0.4, disks)], axis=-1)
    radii = random.uniform(0.055, 0.085, disks)
    scene = make_scene(positions, random.uniform(7, 9, disks), radii, random.uniform(-3, 3, disks))
    scene[:, VX : OMEGA + 1] = random.normal(size=(disks, 3))
    return scene


@given(angles)
def test_wrapped_angles_lie_in_the_half_open_interval_and_mean_the_same(angle):
    wrapped = float(wrap_angle(np.array(angle)))
    assert -pi < wrapped <= pi
    np.testing.assert_allclose(unit(np.array(wrapped)), unit(np.array(angle)), atol=1e-12)


@given(seeds, angles)
def test_turning_keeps_distances_speeds_and_bodies(seed, angle):
    scene = random_scene(seed)
    turned = rotate_scenes(scene, angle)
    np.testing.assert_allclose(surface_gaps(turned), surface_gaps(scene), atol=1e-9)
    speed = np.hypot(scene[:, VX], scene[:, VY])
    np.testing.assert_allclose(np.hypot(turned[:, VX], turned[:, VY]), speed, atol=1e-9)
    np.testing.assert_array_equal(turned[:, [MASS, RADIUS]], scene[:, [MASS, RADIUS]])


@given(seeds, angles)
def test_mirroring_turns_rotations_around(seed, angle):
    scene = random_scene(seed)
    np.testing.assert_allclose(
        mirror_scenes(rotate_scenes(scene, angle)),
        rotate_scenes(mirror_scenes(scene), -angle),
        atol=1e-9,
    )


def test_a_scene_at_rest_is_settled_and_a_slowly_creeping_one_is_not():
    scene = make_scene(np.array([(0.3, 0.0), (0.6, 0.0)]), np.full(2, 8.0), np.full(2, 0.06))
    moving, turning = scene.copy(), scene.copy()
    moving[1, VY] = 1.1e-3
    turning[0, OMEGA] = -1.1e-2
    np.testing.assert_array_equal(
        is_settled(np.stack([scene, moving, turning])), [True, False, False]
    )


@pytest.mark.parametrize(
    ("disk", "column", "value", "message"),
    [
        (0, X, np.nan, "x of disk 0 is nan; must be finite"),
        (2, THETA, np.inf, "theta of disk 2 is inf; must be finite"),
        (1, MASS, 0.0, "mass of disk 1 is 0.0; it must be positive"),
        (1, RADIUS, -0.1, "radius of disk 1 is -0.1; it must be positive"),
    ],
)
def test_a_scene_that_cannot_exist_is_refused(disk, column, value, message):
    scene = random_scene(1)
    scene[disk, column] = value
    with pytest.raises(InvalidInputError, match=message):
        check_bodies(scene)
