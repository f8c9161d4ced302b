"""A shape that no package of the project has: what a user adds, in one place."""

from collections.abc import Iterator

import pytest

from sain_core.shapes import registry
from sain_core.shapes.polygon import Polygon, regular_corners

HEXAGON = Polygon("six_sided", corners=regular_corners(6))


@pytest.fixture
def own_shapes() -> Iterator[None]:
    """Forget after a test which shapes it registered."""
    names, footprints = dict(registry._shapes), dict(registry._footprints)
    yield
    registry._load_offered.cache_clear()
    registry._failed.clear()
    for known, before in ((registry._shapes, names), (registry._footprints, footprints)):
        known.clear()
        known.update(before)


@pytest.fixture
def hexagon(own_shapes: None) -> Polygon:
    """The hexagon, known by its name while a test runs."""
    registry.register(HEXAGON)
    return HEXAGON
