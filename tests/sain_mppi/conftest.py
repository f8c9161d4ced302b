"""A scene of two disks, and a fast model of them."""

import numpy as np
import pytest

from sain_core.scene import make_scene
from sain_model.physics.planar import PlanarPrior


@pytest.fixture
def dynamics():
    """A model that any planner test can roll out."""
    return PlanarPrior()


@pytest.fixture
def scene():
    """The target in front of the mid disk, touching it but for 1 mm."""
    return make_scene(
        np.array([[0.40, 0.0], [0.541, 0.0]]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
    )
