"""Where strokes begin, and where their tool first touches the body that it pushes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH
from sain_core.scene import OVERLAP_TOLERANCE
from sain_core.shapes.bodies import Bodies
from sain_core.types import Indices, Mask, Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.physics.body_table import body_table
from sain_model.physics.touch_kernels import (
    DISTANCE,
    GAP,
    GAP_BODY,
    NORMAL,
    TOUCH_SIZE,
    find_touches,
)


@dataclass(frozen=True, eq=False)
class FirstTouch:
    """Of each of B strokes.

    Attributes:
        gap: between the tool and the nearest body before the stroke [m]; negative: they overlap.
        nearest: which body that is.
        distance: of travel until the tool touches the body that is pushed [m]; infinite: it misses.
        normal: heading of that body's inward normal there [rad]; of a miss that of travel.
    """

    gap: Float[ndarray, "B"]
    nearest: Indices
    distance: Float[ndarray, "B"]
    normal: Float[ndarray, "B"]

    @property
    def inside(self) -> Mask:
        """Which strokes begin inside a body: by more than a scene may be measured wrongly."""
        return np.asarray(self.gap < -OVERLAP_TOLERANCE)


def first_touch(scenes: Scenes, strokes: Pushes, bodies: Bodies) -> FirstTouch:
    """Return where strokes (B, 8) in scenes (B, N, 8) begin and first touch."""
    touches = np.zeros((len(scenes), TOUCH_SIZE))
    table = body_table(bodies.fitted(scenes.shape[1]))
    find_touches(plain(scenes), plain(strokes), table, touches)
    gap, distance, normal = touches[:, GAP], touches[:, DISTANCE], touches[:, NORMAL]
    return FirstTouch(gap, touches[:, GAP_BODY].astype(np.int64), distance, normal)


def check_starts(scenes: Scenes, strokes: Pushes, bodies: Bodies) -> None:
    """Check that no stroke (B, 8) that moves begins with the tool inside a body.

    An overlap of up to `OVERLAP_TOLERANCE` is taken as touching: poses are measured.

    Raises:
        InvalidInputError: naming the first that does.
    """
    touch = first_touch(scenes, strokes, bodies)
    wrong = touch.inside & (strokes[:, LENGTH] > 0.0)
    if wrong.any():
        index = int(np.argmax(wrong))
        raise InvalidInputError(
            f"stroke {index} begins with the tool {-1e3 * touch.gap[index]:.2f} mm inside body"
            f" {touch.nearest[index]}; it must begin outside of all bodies (overlaps up to"
            f" {1e3 * OVERLAP_TOLERANCE:g} mm are taken as touching)"
        )
