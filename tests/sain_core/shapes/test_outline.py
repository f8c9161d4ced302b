"""Points on outlines: laws that hold for every shape."""

from math import pi

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from sain_core.scene import unit, wrap_angle
from sain_core.shapes.library import get_shape, library
from sain_core.shapes.shape import distance_to_way, is_inside, outline_of

ALL = pytest.mark.parametrize(
    "shape", [*library(), get_shape("cube")], ids=lambda shape: shape.name
)
HOLLOW = ("half_ring", "u", "ring_segment", "l", "corner")
LOCATIONS = np.linspace(-pi, pi, 721)[1:]


@ALL
def test_every_location_is_a_point_on_the_outline(shape):
    points, normals = outline_of(shape).at(LOCATIONS)
    ring = Polygon(shape.outline(1.0))
    assert max(ring.exterior.distance(Point(point)) for point in points) < 1e-9
    inside = points + 1e-6 * unit(normals)
    assert (
        is_inside(
            inside, np.broadcast_to(shape.outline(1.0), (720, *shape.outline(1.0).shape))
        ).mean()
        > 0.99
    )


@ALL
def test_equal_steps_of_the_location_are_equal_steps_along_the_outline(shape):
    ring = Polygon(shape.outline(1.0)).exterior
    points, _ = outline_of(shape).at(LOCATIONS)
    along = np.unwrap([2 * pi * ring.project(Point(p), normalized=True) for p in points])
    assert np.allclose(np.diff(along), 2 * pi / 720, atol=1e-9)  # also counter-clockwise


@ALL
def test_location_zero_is_the_leftmost_point(shape):
    (point,), _ = outline_of(shape).at(np.zeros(1))
    assert point[0] == pytest.approx(shape.outline(1.0)[:, 0].min(), abs=1e-6)


def test_a_disk_drawn_with_many_corners_has_the_disk_s_locations():
    points, normals = outline_of(get_shape("disk")).at(LOCATIONS)
    assert np.allclose(points, -unit(LOCATIONS), atol=2e-3)
    assert np.abs(wrap_angle(normals - LOCATIONS)).max() < 0.05


def test_a_corner_starts_the_side_after_it():
    square = outline_of(get_shape("square"))
    _, normals = square.at(np.array([0.0, pi / 4 - 1e-9, pi / 4, pi / 2, pi, -pi / 2]))
    assert np.allclose(normals, [0.0, 0.0, pi / 2, pi / 2, pi, -pi / 2])


def test_an_outline_written_from_another_corner_has_the_same_locations():
    shape = get_shape("t")
    turned = type(shape)("turned", tuple(p[2:] + p[:2] for p in shape.polygons[::-1]))
    first, second = (outline_of(one).at(LOCATIONS)[0] for one in (shape, turned))
    assert np.allclose(first, second, atol=1e-9)


def test_the_inner_corners_of_a_t_can_be_named():
    shape = get_shape("t")
    corners = shape.outline(1.0)
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    turn = np.cross(np.c_[corners - before, np.zeros(8)], np.c_[after - corners, np.zeros(8)])[:, 2]
    inner = corners[turn < 0.0]
    assert len(inner) == 2
    points, _ = outline_of(shape).at(np.linspace(-pi, pi, 100_001))
    for corner in inner:
        assert np.linalg.norm(points - corner, axis=1).min() < 1e-4


@ALL
def test_a_push_that_faces_a_way_goes_through_the_middle(shape):
    headings = np.linspace(-pi, pi, 16)
    locations, angles = outline_of(shape).facing(headings)
    points, normals = outline_of(shape).at(locations)
    assert np.allclose(wrap_angle(normals + angles - headings), 0.0, atol=1e-9)
    bearing = np.arctan2(points[:, 1], points[:, 0])
    apart = np.abs(wrap_angle(bearing - headings - pi))
    # Seen from the middle of a hollow shape, the outline is not all around.
    assert apart.max() < (0.9 if shape.name in HOLLOW else 0.1)


def test_distances_of_ways_agree_with_shapely():
    random = np.random.default_rng(0)
    start, end = random.uniform(-1.5, 1.5, (2, 300, 2))
    corners = get_shape("star").outline(1.0)
    found = distance_to_way(start, end, np.broadcast_to(corners, (300, *corners.shape)))
    ring = Polygon(corners)
    for one, first, last in zip(found, start, end, strict=True):
        if ring.contains(Point(first)):
            assert one < 0.0
        else:
            assert one == pytest.approx(ring.distance(LineString([first, last])), abs=1e-9)
