"""Which pushes may be planned next from a scene."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import wrap_angle
from sain_core.types import Mask, PushArray, Pushes, Scene

REFUSED_NEARBY: Final = np.array([0.15, 0.15, 0.02])  # [rad, rad, m], too like a refused push


def permitted(
    scene: Scene, pushes: Pushes, feasibility: Feasibility, refused: Sequence[PushArray] = ()
) -> Mask:
    """Tell which pushes (B, 3) touch the mid disk of a scene (N, 8) and can be carried out.

    What was refused, (3,) each, or is very like it, is not permitted either.
    """
    scenes = np.broadcast_to(scene, (len(pushes), *scene.shape))
    ok = feasibility.mask(scenes, pushes) & (pushes[:, LENGTH] > feasibility.limits.clearance)
    for one in refused:
        apart = np.abs(pushes - one)
        apart[:, LOCATION] = np.abs(wrap_angle(pushes[:, LOCATION] - one[LOCATION]))
        ok &= (apart > REFUSED_NEARBY)[:, [LOCATION, ANGLE, LENGTH]].any(axis=1)
    return np.asarray(ok)
