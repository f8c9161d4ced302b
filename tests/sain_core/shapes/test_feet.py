"""Feet depend on the outline, not on how it is written, and follow its reflection."""

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from sain_core.shapes.feet import balanced_feet
from sain_core.shapes.library import SHAPES
from sain_core.shapes.polygon import Compound

ALL = pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
L = (
    ((0.0, 0.0), (1.0, 0.0), (1.0, 4.0), (0.0, 4.0)),
    ((1.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0)),
)
EITHER_WAY = ("t", "l", "corner", "u", "arrow", "kite", "right_triangle", "random_3", "pentagon")


def ordered(feet):
    return feet[np.lexsort(np.round(feet, 4).T)]


def assert_same(some, others):
    np.testing.assert_allclose(ordered(some), ordered(others), atol=1e-6)


@ALL
def test_the_first_corner_does_not_matter(shape):
    outline, feet = shape.outline(1.0), shape.supports(1.0)
    assert_same(balanced_feet(np.roll(outline, 1, axis=0)), feet)
    assert_same(balanced_feet(np.roll(outline, -3, axis=0)), feet)


@ALL
def test_the_reflected_outline_has_the_reflected_feet(shape):
    image = shape.outline(1.0)[::-1] * (1.0, -1.0)
    assert_same(balanced_feet(image), shape.supports(1.0) * (1.0, -1.0))


@pytest.mark.parametrize("name", EITHER_WAY)
def test_so_it_is_in_the_other_axis_unless_a_half_turn_changes_nothing(name):
    (shape,) = (shape for shape in SHAPES if shape.name == name)
    image = shape.outline(1.0)[::-1] * (-1.0, 1.0)
    assert_same(balanced_feet(image), shape.supports(1.0) * (-1.0, 1.0))


@ALL
def test_single_precision_is_enough(shape):
    """A shape that came in a message stands as the one that was sent."""
    sent = shape.outline(1.0).astype(np.float32).astype(np.float64)
    assert_same(np.round(balanced_feet(sent), 5), np.round(shape.supports(1.0), 5))


@ALL
def test_each_foot_carries_a_fair_part_below_the_body(shape):
    feet = shape.supports(1.0)
    loads = np.linalg.solve(np.vstack([feet.T, np.ones(3)]), [0.0, 0.0, 1.0])
    assert loads.min() > 0.2
    inside = Polygon(shape.outline(1.0))
    for foot in feet:
        assert inside.covers(Point(foot))
        assert inside.exterior.distance(Point(foot)) > 0.01
    assert LineString(feet).length > 1.0


def test_parts_and_corners_may_be_written_in_any_way():
    feet = Compound.of("l", *L).supports(1.0)
    cut = (
        ((0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0)),
        ((0.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0)),
    )
    assert_same(Compound.of("l", *cut).supports(1.0), feet)
    assert_same(Compound.of("l", *(part[2:] + part[:2] for part in L[::-1])).supports(1.0), feet)
    straight = ((0, 0), (0.4, 0), (1, 0), (3, 0), (3, 1), (1, 1), (1, 4), (0, 4), (0, 2))
    outline = Compound.of("l", *L).outline(1.0)
    moved = np.array(straight, dtype=float)
    scale = np.ptp(outline[:, 0]) / 3
    moved = moved * scale + outline.min(axis=0)
    assert_same(balanced_feet(moved), feet)
