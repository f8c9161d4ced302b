"""Flat bottoms: where the points are, and how they share the load."""

import numpy as np
import pytest

from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import even_supports, flat_bottom

SHAPES = ("disk", "square", "t", "star", "bar", "ring_segment")


@pytest.mark.parametrize("name", SHAPES)
def test_the_points_lie_within_the_outline_and_balance(name: str) -> None:
    shape = get_shape(name)
    points, shares = flat_bottom(shape)
    assert 20 <= len(points) <= 60
    assert shares.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(shares @ points, 0.0, atol=1e-12)
    assert np.hypot(*points.T).max() <= 1.1 * shape.circumradius


def test_a_uniform_disk_resists_turning_at_two_thirds_of_its_radius() -> None:
    points, shares = flat_bottom(get_shape("disk"))
    assert shares @ np.hypot(*points.T) == pytest.approx(2.0 / 3.0, rel=0.03)


def test_pressure_moves_the_load_to_the_rim_or_to_the_middle() -> None:
    arms = []
    for pressure in (-0.5, 0.0, 2.0):
        points, shares = flat_bottom(get_shape("square"), pressure)
        arms.append(shares @ np.hypot(*points.T))
    assert arms[0] < 0.95 * arms[1] < 0.95 * 0.9 * arms[2]


@pytest.mark.parametrize("name", SHAPES)
def test_even_supports_slide_and_turn_as_uniform_pressure(name: str) -> None:
    shape = get_shape(name)
    points = even_supports(shape)
    fine, shares = flat_bottom(shape)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=1e-12)
    moments = (fine.T * shares) @ fine
    np.testing.assert_allclose(points.T @ points / 9, moments, atol=0.06 * np.trace(moments))
    assert np.hypot(*points.T).mean() == pytest.approx(shares @ np.hypot(*fine.T), rel=0.06)
