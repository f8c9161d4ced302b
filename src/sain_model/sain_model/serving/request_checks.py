"""Whether scenes and pushes that a model is asked about can be."""

from typing import Final

import numpy as np

from sain_core.errors import OutOfRangeError
from sain_core.push import check_predictable, pushed_bodies
from sain_core.scene import OVERLAP_TOLERANCE
from sain_core.shapes.bodies import Bodies, check_scenes
from sain_core.types import Pushes, Scenes

SEEN_OVERLAP: Final = 0.02  # [m], of bodies with corners: cameras are not exact


def check_asked_scenes(scenes: Scenes, bodies: Bodies) -> None:
    """Raise `InvalidInputError` unless all scenes (B, N, 8) can be of these bodies."""
    check_scenes(scenes, bodies, OVERLAP_TOLERANCE if bodies.all_round else SEEN_OVERLAP)


def check_asked_pushes(pushes: Pushes, bodies: Bodies) -> None:
    """Raise `OutOfRangeError` unless all pushes can be asked about, against pushable bodies."""
    check_predictable(pushes)
    pushed = np.unique(pushed_bodies(pushes))
    wrong = [int(body) for body in pushed if body not in bodies.pushable]
    if wrong:
        role = bodies.roles[wrong[0]] if wrong[0] < len(bodies) else "not there"
        raise OutOfRangeError(
            f"a push is against body {wrong[0]}, which is {role};"
            f" pushable are: {', '.join(map(str, bodies.pushable))}"
        )
