"""``./env python -m pytest examples/my_world``: the world keeps the contract."""

import numpy as np
from my_world import load

from sain_core.conformance import check_world, two_disks
from sain_core.push import make_push
from sain_core.scene import MID, TARGET, X


def test_it_keeps_the_contract_and_the_tool_carries_both_disks() -> None:
    """The tool travels 5 mm until it touches; the disks have 10 mm between them."""
    start = two_disks()
    after = check_world(load("my_world"), start, make_push(0.0, 0.0, 0.045))
    np.testing.assert_allclose((after - start.scene)[[MID, TARGET], X], (0.040, 0.030), atol=1e-6)
