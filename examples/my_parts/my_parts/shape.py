"""A shape: an arrow of a shaft and a head."""

from sain_core.shapes.solids import Prism

SHAFT = ((0, -1), (4, -1), (4, 1), (0, 1))  # counter-clockwise, in any unit
HEAD = ((4, -2), (7, 0), (4, 2))

ARROW = Prism.of("my_arrow", SHAFT, HEAD)
