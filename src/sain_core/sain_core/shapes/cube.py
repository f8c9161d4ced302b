"""A square block that is as wide as the disk it replaces: its radius is half its width."""

from typing import ClassVar, Final

from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.polygon import Polygon
from sain_core.shapes.shape import Solid, Vector


class Cube(Polygon):
    """An upright square block; `DISK_HEIGHT` high like every body."""

    solid: ClassVar = Solid.BOX

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the principal moments [kg m^2] of a uniform block."""
        across = mass * ((2 * radius) ** 2 + DISK_HEIGHT**2) / 12
        return across, across, mass * (2 * radius) ** 2 / 6


SHAPES: Final = (Cube("cube", corners=((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))),)
