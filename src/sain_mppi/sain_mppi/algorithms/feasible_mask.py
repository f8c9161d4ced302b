"""Which pushes may be planned next from a scene."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.push import LENGTH, LOCATION, PATH, pushed_bodies
from sain_core.scene import wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Mask, PushArray, Pushes, Scene

REFUSED_NEARBY: Final = np.array([0.15, 0.15, 0.02])  # [rad, rad, m], too like a refused push


def permitted(
    scene: Scene,
    pushes: Pushes,
    feasibility: Feasibility,
    refused: Sequence[PushArray] = (),
    bodies: Bodies = PAPER_DISKS,
    shortest: float = 0.0,
) -> Mask:
    """Tell which pushes (B, 5) touch their body in a scene (N, 8) and can be carried out.

    What was refused, (5,) each, or is very like it, is not permitted either. Nor is what moves its
    body by less than the `shortest` way [m].
    """
    scenes = np.broadcast_to(scene, (len(pushes), *scene.shape))
    ok = feasibility.mask(scenes, pushes, bodies) & (
        pushes[:, LENGTH] > feasibility.limits.clearance + shortest
    )
    for one in refused:
        apart = np.abs(pushes - one)
        apart[:, LOCATION] = np.abs(wrap_angle(pushes[:, LOCATION] - one[LOCATION]))
        unlike = (apart[:, PATH] > REFUSED_NEARBY).any(axis=1)
        ok &= unlike | (pushed_bodies(pushes) != pushed_bodies(one))
    return np.asarray(ok)
