"""Flat bottoms: where the points are, and how they share the load."""

from math import nan, pi

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import Compound, Polygon, even_supports, flat_bottom
from tests.hexagon import regular_corners

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
        (((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), r"centroid at \(0.3333, 0.3333\)"),
    ],
)
def test_corners_that_make_no_body_are_refused(corners, message):
    with pytest.raises(ConfigError, match=f"shape 'odd' has .*{message}"):
        Polygon("odd", corners=corners)


@pytest.mark.parametrize(
    ("corners", "turn"),
    [
        (regular_corners(3), 2 * pi / 3),
        (regular_corners(5), 2 * pi / 5),
        (tuple((2 * x, y) for x, y in SQUARE), pi),
        (((1.0, 0.0), (-0.5, 1.0), (-0.5, -1.0)), 2 * pi),
    ],
)
def test_the_symmetry_comes_from_the_corners(corners, turn):
    assert Polygon("any", corners=corners).symmetry == pytest.approx(turn)


@pytest.mark.parametrize("scale", [1e-200, 1e-9, 1e9, 1e200])
def test_outlines_of_no_size_that_can_be_meant_are_refused(scale):
    corners = tuple((scale * x, scale * y) for x, y in SQUARE)
    with pytest.raises(ConfigError, match=r"shape 'odd' has its farthest corner at .*; allowed: 0"):
        Polygon("odd", corners=corners)
    with pytest.raises(ConfigError, match=r"part 0 of shape 'odd' has its farthest corner at 1\.4"):
        Compound.of("odd", corners)


@pytest.mark.parametrize("scale", [0.01, 1e5])
def test_any_other_size_of_an_outline_is_the_same_shape(scale):
    corners = tuple((scale * x, scale * y) for x, y in SQUARE)
    assert Compound.of("odd", corners).outline(1.0) == pytest.approx(
        Compound.of("odd", SQUARE).outline(1.0)
    )


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
