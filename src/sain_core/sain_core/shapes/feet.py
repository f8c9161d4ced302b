"""Where a body stands on the table: three feet, chosen from its outline alone.

The choice does not depend on the corner that an outline begins with. That of an outline reflected
in the x axis is the reflected choice, as `mirror_scenes` reflects scenes.
"""

from itertools import combinations
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

INSET: Final = 0.06  # [radii], from the outline to the middle of a foot, where there is room
PLACES: Final = 48  # along the inset outline, about: each side has its own, an odd number and even
SAME: Final = 1e-5  # [radii], within which places and worths are equal: more than single precision

Corners = Float[ndarray, "M 2"]
Places = Float[ndarray, "P 2"]
Choices = Int[ndarray, "T 3"]  # three places each, in increasing order


def balanced_feet(outline: Corners) -> Float[ndarray, "3 2"]:
    """Return three points within an outline (M, 2) that carry a body at (0, 0) well.

    They stand far apart, and each carries much of the weight. Where the outline is its own image
    in the x axis, or else in the y axis, so are the feet.
    """
    places = _places(outline)
    choices = np.array(list(combinations(range(len(places)), 3)))
    worth = _worth(places, choices)
    for image in ((1.0, -1.0), (-1.0, 1.0)):
        symmetric = _symmetric(outline, places, choices, np.array(image))
        if worth[symmetric].max(initial=0.0) > 0.0:
            choices, worth = choices[symmetric], worth[symmetric]
            break
    best = places[choices[worth > worth.max() * (1.0 - SAME)]]  # (B, 3, 2), equally good
    x, y = best[..., 0], best[..., 1]
    square = x**2 + y**2  # tells them apart whatever the frame, and then x does in any image
    keys = np.stack([square.sum(1), (square**2).sum(1), (x**3).sum(1), (x * y**2).sum(1), x.max(1)])
    feet = best[np.lexsort(np.round(keys[::-1] / SAME))[-1]]
    return np.asarray(feet[np.lexsort(feet.T)])


def _places(outline: Corners) -> Places:
    """Return where a foot may stand (P, 2): along the outline, set in where there is room."""
    from shapely import Polygon, get_parts  # half the time of an import of this module

    ring = Polygon(outline)
    inset = next(
        area
        for share in (1.0, 0.5, 0.25, 0.0)
        if (area := ring.buffer(-share * INSET, join_style="mitre")).area
    )
    rings = [_corners(np.array(part.exterior.coords)[:-1]) for part in get_parts(inset)]
    perimeter = sum(float(np.linalg.norm(_sides(corners), axis=1).sum()) for corners in rings)
    return np.concatenate([_along(corners, perimeter) for corners in rings])


def _corners(ring: Corners) -> Float[ndarray, "K 2"]:
    """Return the corners of a ring (M, 2), without those in the middle of a straight side."""
    before, after = ring - np.roll(ring, 1, axis=0), _sides(ring)
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return ring[np.abs(turn) > SAME * np.hypot(*before.T) * np.hypot(*after.T)]


def _along(corners: Corners, perimeter: float) -> Places:
    """Return the corners of a ring, and places on each side as close to each other as on others."""
    places = [corners]
    for start, way in zip(corners, _sides(corners), strict=True):
        count = int(PLACES * np.hypot(*way) / perimeter + SAME)
        count = max(count - (count + 1) % 2, 1)  # odd: one is in the middle
        places.append(start + np.arange(1, count + 1)[:, None] / (count + 1) * way)
    return np.concatenate(places)


def _worth(places: Places, choices: Choices) -> Float[ndarray, "T"]:
    """Return the smallest share of the weight on a foot times the root of the area between them."""
    first, second, third = places[choices].swapaxes(0, 1)
    area = _cross(second - first, third - first)
    loads = np.stack([_cross(second, third), _cross(third, first), _cross(first, second)])
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.nan_to_num((loads / area).min(axis=0), nan=-1.0, posinf=-1.0, neginf=-1.0)
    return np.asarray(least * np.sqrt(np.abs(area)))


def _symmetric(
    outline: Corners, places: Places, choices: Choices, image: Float[ndarray, "2"]
) -> Bool[ndarray, "T"]:
    """Tell which choices are their own image; none where the outline is not its own."""
    partner, apart = _partners(places, image)
    if max(float(_partners(_corners(outline), image)[1]), float(apart)) > SAME:
        return np.zeros(len(choices), dtype=bool)
    return np.asarray((np.sort(partner[choices], axis=1) == choices).all(axis=1))


def _partners(points: Places, image: Float[ndarray, "2"]) -> tuple[Int[ndarray, "P"], float]:
    """Return which of points (P, 2) is nearest to the image of each, and the largest distance."""
    apart = np.linalg.norm(points[:, None] * image - points, axis=-1)
    return apart.argmin(axis=1), float(apart.min(axis=1).max())


def _sides(ring: Corners) -> Corners:
    return np.asarray(np.roll(ring, -1, axis=0) - ring)


def _cross(first: ndarray, second: ndarray) -> ndarray:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
