"""Disks: on three feet, which makes the contact with the table repeatable, or flat."""

from dataclasses import dataclass
from math import pi
from typing import ClassVar, Final

import numpy as np

from sain_core.scene import DISK_HEIGHT, unit
from sain_core.shapes.shape import REGULAR_FEET, Pair, Shape, Solid, Vector
from sain_core.types import Points

DISK: Final = "disk"
THREE_FEET: Final = "three_feet"
FLAT: Final = "flat"  # as in the paper
DISK_SHAPES: Final = (THREE_FEET, FLAT)
CORNERS: Final = 72  # of an outline


@dataclass(frozen=True)
class Disk(Shape):
    """An upright cylinder."""

    feet: tuple[Pair, ...] = REGULAR_FEET

    solid: ClassVar = Solid.CYLINDER
    footprint = DISK
    symmetry = 0.0
    circumradius = 1.0

    def outline(self, radius: float) -> Points:
        """Return points (72, 2) [m] on a circle."""
        return np.asarray(radius * unit(np.arange(CORNERS) * 2 * pi / CORNERS))

    def parts(self, radius: float) -> tuple[Points, ...]:
        """Return the one polygon that a circle is drawn as."""
        return (self.outline(radius),)

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the principal moments [kg m^2] of a uniform cylinder."""
        across = mass * (3 * radius**2 + DISK_HEIGHT**2) / 12
        return across, across, mass * radius**2 / 2


SHAPES: Final = (Disk(THREE_FEET), Disk(FLAT, feet=()))
