"""One world for all tests here; they reset it."""

import pytest

from sain_pusht.world import PushtWorld


@pytest.fixture(scope="session")
def world() -> PushtWorld:
    """Return gym-pusht as a world."""
    return PushtWorld()
