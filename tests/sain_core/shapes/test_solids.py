"""Flat bottoms: where the points are, and how they share the load."""

from math import nan

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import Prism, even_supports, flat_bottom

SQUARE = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (SQUARE[:2], r"\b2 corners; it needs 3 or more"),
        (SQUARE[::-1], "allowed: a convex polygon, counter-clockwise"),
        ((SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2]), "allowed: a convex polygon"),  # crossed
        ((*SQUARE[:3], (0.0, 0.0)), "allowed: a convex polygon"),  # dented
        ((*SQUARE, (0.0, 1.0)), "allowed: a convex polygon"),
        ((*SQUARE, SQUARE[3]), "allowed: a convex polygon"),  # a side without length
        ((*SQUARE[:3], (nan, -1.0)), "give finite ones"),
        (tuple((1e-9 * x, 1e-9 * y) for x, y in SQUARE), "its farthest corner at 1.41e-09"),
    ],
)
def test_corners_that_make_no_body_are_refused(corners, message):
    with pytest.raises(ConfigError, match=f"shape 'odd' has .*{message}"):
        Prism.of("odd", corners)


SHAPES = ("disk", "square", "t", "star", "bar", "ring_segment")


@pytest.mark.parametrize("name", SHAPES)
def test_the_points_lie_within_the_outline_and_balance(name):
    shape = get_shape(name)
    points, shares = flat_bottom(shape)
    assert 20 <= len(points) <= 60
    assert shares.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(shares @ points, 0.0, atol=1e-12)
    assert np.hypot(*points.T).max() <= 1.1 * shape.circumradius


@pytest.mark.parametrize("name", SHAPES)
def test_even_supports_slide_and_turn_as_uniform_pressure(name):
    shape = get_shape(name)
    points = even_supports(shape)
    fine, shares = flat_bottom(shape)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=1e-12)
    moments = (fine.T * shares) @ fine
    np.testing.assert_allclose(points.T @ points / 9, moments, atol=0.06 * np.trace(moments))
    assert np.hypot(*points.T).mean() == pytest.approx(shares @ np.hypot(*fine.T), rel=0.06)
