"""What bodies stand on: three feet, or a flat bottom, as points that each carry a part of it."""

from functools import lru_cache
from itertools import combinations
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.shapes.outline import is_inside
from sain_core.shapes.shape import Shape
from sain_core.types import Mask, Points

INSET: Final = 0.06  # [radii], from the outline to the middle of a foot, where there is room
PLACES: Final = 48  # along the inset outline, of which three are chosen


def balanced_feet(outline: Points) -> ndarray:
    """Return three points (3, 2) within an outline (M, 2) that carry a body at (0, 0) well.

    They stand far apart, and each carries much of the weight. Among choices that are equally good,
    the corner that the outline begins with decides.
    """
    from shapely import Polygon, get_parts  # half the time of an import of this module

    ring = Polygon(outline)
    inset = next(
        area for share in (1.0, 0.5, 0.25, 0.0) if (area := ring.buffer(-share * INSET)).area
    )
    lines = [part.exterior for part in get_parts(inset)]
    steps = np.arange(PLACES) / PLACES
    places = np.concatenate(
        [[line.interpolate(step, normalized=True).coords[0] for step in steps] for line in lines]
    )
    choices = np.array(list(combinations(range(len(places)), 3)))
    first, second, third = places[choices].swapaxes(0, 1)
    area = _cross(second - first, third - first)
    loads = np.stack([_cross(second, third), _cross(third, first), _cross(first, second)])
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.nan_to_num((loads / area).min(axis=0), nan=-1.0, posinf=-1.0, neginf=-1.0)
    best = int(np.argmax(least * np.sqrt(np.abs(area))))
    return np.stack([first[best], second[best], third[best]])


def _cross(first: ndarray, second: ndarray) -> ndarray:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


CELLS: Final = 24  # squares of which a bottom consists, about; those at its rim are cut
FINE: Final = 8  # points along the side of a square, that tell how much of it lies within
EVEN: Final = 9  # supports that carry the same


def flat_bottom(shape: Shape, pressure: float = 0.0) -> tuple[Points, Float[ndarray, "F"]]:
    """Return points (F, 2) [radii] within an outline, and the share of the load on each, (F,).

    Args:
        shape: of the body.
        pressure: exponent of the distance from the middle: 0 is uniform pressure, above 0 there is
            more of it towards the rim, below 0 towards the middle.
    """
    reach = shape.circumradius
    side = reach * np.sqrt(_area(shape) / CELLS)
    count = int(np.ceil(reach / side)) * FINE
    line = (np.arange(-count, count) + 0.5) * (side / FINE)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    fine = grid[_within(shape, grid)]
    fine = fine - fine.mean(axis=0)
    _, cell, area = np.unique(
        np.floor(fine / side).astype(int), axis=0, return_inverse=True, return_counts=True
    )
    points = np.zeros((len(area), 2))
    np.add.at(points, cell.reshape(-1), fine)
    points /= area[:, None]
    shares = area * np.maximum(np.hypot(*points.T), 0.25 * side) ** pressure
    return points, shares / shares.sum()


@lru_cache(maxsize=256)
def even_supports(shape: Shape) -> Points:
    """Return points (9, 2) [radii] that carry a body as uniform pressure does, each a ninth of it.

    They are the middles of nine equal parts of the footprint, moved so that they have its second
    moments: a body slides and begins to turn as on the whole bottom, and its torsion is within 5 %.
    """
    line = (np.arange(-60, 60) + 0.5) * (shape.circumradius / 60)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    fine = grid[_within(shape, grid)]
    fine = fine - fine.mean(axis=0)
    middles = np.array([part.mean(axis=0) for strip in _thirds(fine) for part in _thirds(strip)])
    middles -= middles.mean(axis=0)
    stretch = np.linalg.inv(_root(middles)) @ _root(fine)
    return np.asarray(middles @ stretch)


def support_points(shape: Shape, radius: float) -> Points:
    """Return points (F, 2) [m] that a body stands on: its three feet, or nine of a flat bottom."""
    return radius * even_supports(shape) if shape.lies_flat else shape.supports(radius)


def _thirds(points: ndarray) -> list[ndarray]:
    """Cut points (P, 2) into equal parts across the way in which they reach farthest."""
    about = points - points.mean(axis=0)
    spread, axes = np.linalg.eigh(about.T @ about)
    even = spread[0] > 0.99 * spread[1]
    order = np.argsort(about @ (np.array([1.0, 0.0]) if even else axes[:, 1]), kind="stable")
    return [points[part] for part in np.array_split(order, 3)]


def _root(points: Points) -> Float[ndarray, "2 2"]:
    """Return the symmetric root of the second moments of points (P, 2)."""
    spread, axes = np.linalg.eigh(points.T @ points / len(points))
    return np.asarray((axes * np.sqrt(spread)) @ axes.T)


def _area(shape: Shape) -> float:
    """Return the area in units of the square of the circumscribed radius."""
    if shape.is_round:
        return np.pi
    here = shape.outline(1.0) / shape.circumradius
    after = np.roll(here, -1, axis=0)
    return float(0.5 * (here[:, 0] * after[:, 1] - here[:, 1] * after[:, 0]).sum())


def _within(shape: Shape, points: Points) -> Mask:
    """Tell which points (P, 2) [radii] lie within the outline."""
    if shape.is_round:
        return np.asarray(np.hypot(*points.T) < shape.circumradius)
    corners = shape.outline(1.0)
    return is_inside(points, np.broadcast_to(corners, (len(points), *corners.shape)))
