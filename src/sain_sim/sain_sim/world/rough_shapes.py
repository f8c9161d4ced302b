"""What a laboratory's errors are on bodies that do not stand as a disk does.

Errors are drawn for disks. A shape of the library has its own feet, and each of these is off by
as much as that foot of a disk: in bearing, and in distance as a share.
"""

from dataclasses import replace
from math import cos, sin
from typing import Final

import numpy as np
from shapely import MultiPoint, Polygon

from sain_core.shapes.shape import REGULAR_FEET, Pair, Shape
from sain_sim.world.roughness import Feet, Roughness

SHARES: Final = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.0)  # of the errors, the first that fits
LEAST_LOAD: Final = 0.1  # of the weight, on each foot; a third on each is even


def fit_shapes(roughness: Roughness, shapes: tuple[Shape, ...]) -> Roughness:
    """Return the errors of disks as those of bodies with these shapes.

    Bodies on a disk's regular feet, or on none, keep theirs. For others both errors are made
    smaller, by the same share, until all feet are below the body and each carries a part of it.
    """
    regular = (REGULAR_FEET,) * len(shapes)
    made = [
        (feet, roughness.mass_offset(body))
        if shape.feet in ((), REGULAR_FEET)
        else _fit(shape, feet, roughness.mass_offset(body))
        for body, (shape, feet) in enumerate(zip(shapes, roughness.feet or regular, strict=True))
    ]
    feet, offsets = zip(*made, strict=True)
    return replace(
        roughness,
        feet=feet if roughness.feet else (),
        mass_offsets=offsets if roughness.mass_offsets else (),
    )


def _fit(shape: Shape, of_disk: tuple[Pair, ...], offset: Pair) -> tuple[Feet, Pair]:
    """Return feet and centre of mass of a shape, by those of a disk."""
    outline = Polygon(shape.outline(1.0)).buffer(1e-9)
    for share in SHARES:
        feet = _moved(shape, of_disk, share)
        mass = share * offset[0], share * offset[1]
        places = [(away * cos(bearing), away * sin(bearing)) for away, bearing in feet]
        if outline.covers(MultiPoint(places)) and _least_load(places, mass) >= LEAST_LOAD:
            break
    return feet, mass


def _moved(shape: Shape, of_disk: tuple[Pair, ...], share: float) -> Feet:
    """Return a shape's feet, anticlockwise, off by a share of the errors of a disk's."""
    own = sorted(shape.feet, key=lambda foot: foot[1])
    first, second, third = (
        (away * (1.0 + share * (far / regular - 1.0)), bearing + share * (turned - right))
        for (away, bearing), (far, turned), (regular, right) in zip(
            own, of_disk, REGULAR_FEET, strict=True
        )
    )
    return first, second, third


def _least_load(feet: list[Pair], mass: Pair) -> float:
    """Return the share of the weight on the foot of three that carries least."""
    places = np.column_stack([np.ones(3), feet])
    return float(np.linalg.solve(places.T, [1.0, *mass]).min())
