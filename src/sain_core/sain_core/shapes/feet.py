"""Where a body stands on the table: three feet, chosen from its outline alone."""

from itertools import combinations
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.types import Points

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
