"""What holds for every shape, and each one's own numbers."""

from math import pi

import numpy as np
import pytest
from shapely import LineString, MultiPoint, Point, Polygon, contains_xy, union_all

from sain_core.scene import DISK_HEIGHT, make_scene, unit, wrap_angle
from sain_core.shapes.library import get_shape, shape_names
from sain_core.shapes.outlines import trace
from sain_core.shapes.shape import distance_to_way, is_inside, outline_of
from sain_core.types import Points
from tests.hexagon import HEXAGON, SOME

WAIST = (0.06 + 0.02 * np.cos(np.linspace(0.0, 4 * pi, 600, endpoint=False)))[:, None]
TRACED = trace("waist", WAIST * unit(np.linspace(0.0, 2 * pi, 600, endpoint=False))).shape
SHAPES = [*map(get_shape, shape_names()), HEXAGON, TRACED]
ALL = pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
FEW = pytest.mark.parametrize(
    "shape", [*map(get_shape, SOME), HEXAGON, TRACED], ids=lambda shape: shape.name
)


def area(points: Points) -> float:
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


@ALL
def test_an_outline_goes_round_counter_clockwise_about_its_centroid(shape):
    outline = shape.outline(0.06)
    ring = Polygon(outline)
    assert ring.is_simple and ring.exterior.is_ccw
    assert ring.centroid.coords[0] == pytest.approx((0.0, 0.0), abs=1e-7)
    assert np.hypot(*outline.T).max() == pytest.approx(0.06 * shape.circumradius)


@ALL
def test_the_parts_are_convex_and_together_the_outline(shape):
    parts = [Polygon(part) for part in shape.parts(1.0)]
    assert all(part.convex_hull.area == pytest.approx(part.area) for part in parts)
    assert union_all(parts).symmetric_difference(Polygon(shape.outline(1.0))).area < 1e-6
    assert shape.is_convex == (len(parts) == 1)


@FEW
def test_the_supports_lie_within_the_outline_and_about_its_centroid(shape):
    feet = Polygon(shape.supports(1.0))
    assert Polygon(shape.outline(1.0)).buffer(1e-9).covers(MultiPoint(shape.supports(1.0)))
    assert feet.contains(Point(0.0, 0.0))


@ALL
def test_the_symmetry_is_the_smallest_turn_that_changes_nothing(shape):
    def fits(turn: float) -> bool:
        state = make_scene(np.zeros((1, 2)), np.ones(1), np.ones(1), np.array([turn]))[0]
        apart = shape.placed(state)[:, None] - shape.outline(1.0)
        return bool(np.linalg.norm(apart, axis=-1).min(axis=1).max() < 1e-9)

    turn = shape.symmetry or 2 * pi / 72  # a circle is drawn with 72 corners
    assert fits(turn) and not fits(turn / 2)
    assert shape.is_round == (shape.symmetry == 0.0)


@FEW
def test_the_surface_encloses_the_body(shape):
    corners = shape.triangles(0.06)
    volume = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(area(shape.outline(0.06)) * DISK_HEIGHT)
    assert np.ptp(corners[..., 2]) == pytest.approx(DISK_HEIGHT)


@FEW
def test_inertia_is_that_of_many_points_in_the_outline(shape):
    outline = shape.outline(0.06)
    grid = (np.stack(np.meshgrid(*[np.arange(-400, 400)] * 2), -1).reshape(-1, 2) + 0.5) * 0.0002
    inside = contains_xy(Polygon(outline), *grid.T)
    y_square, x_square = (grid[inside, axis].var() for axis in (1, 0))
    upright = DISK_HEIGHT**2 / 12
    expected = 8.0 * np.array([y_square + upright, x_square + upright, x_square + y_square])
    assert np.allclose(shape.inertia(8.0, 0.06), expected, rtol=0.005)


HOLLOW = ("half_ring", "u", "ring_segment", "l", "corner")
LOCATIONS = np.linspace(-pi, pi, 721)[1:]


@FEW
def test_equal_steps_of_the_location_are_equal_steps_along_the_outline(shape):
    outline = shape.outline(1.0)
    ring, (points, normals) = Polygon(outline).exterior, outline_of(shape).at(LOCATIONS)
    assert max(ring.distance(Point(point)) for point in points) < 1e-9
    corners = np.broadcast_to(outline, (720, *outline.shape))
    inside = is_inside(points + 1e-6 * unit(normals), corners)
    assert inside.mean() > 0.99
    along = np.unwrap([2 * pi * ring.project(Point(p), normalized=True) for p in points])
    assert np.allclose(np.diff(along), 2 * pi / 720, atol=1e-9)  # also counter-clockwise


@FEW
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
