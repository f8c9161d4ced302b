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
    VY,
    X,
    is_settled,
    make_scene,
    unit,
    wrap_angle,
)
from sain_core.shapes.bodies import check_bodies

angles = st.floats(-50.0, 50.0)


@given(angles)
def test_wrapped_angles_lie_in_the_half_open_interval_and_mean_the_same(angle):
    wrapped = float(wrap_angle(np.array(angle)))
    assert -pi < wrapped <= pi
    np.testing.assert_allclose(unit(np.array(wrapped)), unit(np.array(angle)), atol=1e-12)


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
    places = np.array([(0.3, 0.0), (0.5, 0.1), (0.7, -0.1)])
    scene = make_scene(places, np.full(3, 8.0), np.full(3, 0.06))
    scene[disk, column] = value
    with pytest.raises(InvalidInputError, match=message):
        check_bodies(scene)
