"""``./env python -m pytest examples/my_model``: the model keeps the contract."""

import numpy as np
from my_model import load

from sain_core.conformance import check_dynamics
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, make_scene


def test_it_keeps_the_contract() -> None:
    """All rules of docs/guides/your_model.md."""
    check_dynamics(load("my_model"))


def test_the_tool_carries_the_mid_disk() -> None:
    """It goes as far as the tool does after it touches."""
    places, masses, radii = np.array([(0.4, 0.0), (0.7, 0.0)]), np.full(2, 8.0), np.full(2, 0.06)
    scene = make_scene(places, masses, radii)
    (predicted,) = load("my_model").step(scene[None], make_push(0.0, 0.0, 0.105)[None])
    np.testing.assert_allclose(predicted[MID, POSITION], (0.5, 0.0))
