"""A shape that no package of the project has, as a user adds one; and a few of those there are."""

from collections.abc import Iterator
from math import cos, pi, sin

import pytest

from sain_core.shapes import library
from sain_core.shapes.solids import Prism


def regular_corners(sides: int) -> tuple[tuple[float, float], ...]:
    """Return a regular polygon around the unit circle, with one side towards -x."""
    bearings = [pi + (2 * side - 1) * pi / sides for side in range(sides)]
    away = 1.0 / cos(pi / sides)
    return tuple((away * cos(bearing), away * sin(bearing)) for bearing in bearings)


HEXAGON = Prism.of("six_sided", regular_corners(6))
SOME = ("disk", "cube", "triangle", "t", "u", "half_ring", "star")  # round, convex, hollow, ragged


@pytest.fixture
def own_shapes() -> Iterator[None]:
    """Forget after a test which shapes it registered."""
    before = dict(library._shapes)
    yield
    library._load_offered.cache_clear()
    library._failed.clear()
    library._shapes.clear()
    library._shapes.update(before)


@pytest.fixture
def hexagon(own_shapes: None) -> Prism:
    """The hexagon, known by its name while a test runs."""
    library.register(HEXAGON)
    return HEXAGON
