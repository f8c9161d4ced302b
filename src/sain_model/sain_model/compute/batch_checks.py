"""Whether a batch of scenes and pushes fits together and can exist."""

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.push import BODY, PUSH_SIZE, STROKE_SIZE, check_predictable
from sain_core.scene import MASS, RADIUS, STATE_NAMES, STATE_SIZE
from sain_core.shapes.bodies import PAPER_DISKS, Bodies


def check_batch(scenes: np.ndarray, pushes: np.ndarray, bodies: Bodies = PAPER_DISKS) -> None:
    """Check that scenes (B, N, 8) and pushes (B, 5) or strokes (B, 8) fit and can exist.

    Raises:
        InvalidInputError: naming what does not.
        OutOfRangeError: a push that no model may be asked about, see `check_predictable`.
    """
    most = len(bodies)
    least = 1 if bodies.are_paper_disks else most
    allowed = f"N = {most}" if least == most else f"N = {least} to {most}"
    if scenes.ndim != 3 or scenes.shape[2] != STATE_SIZE or not least <= scenes.shape[1] <= most:
        raise InvalidInputError(f"scenes have shape (B, N, 8) with {allowed}, not {scenes.shape}")
    if pushes.ndim != 2 or len(pushes) != len(scenes):
        raise InvalidInputError(
            f"pushes have shape ({len(scenes)}, {PUSH_SIZE}), one for each scene, or"
            f" ({len(scenes)}, {STROKE_SIZE}), not {pushes.shape}"
        )
    check_finite("scenes", scenes)
    check_predictable(pushes)
    _check_pushed(pushes[:, BODY], scenes.shape[1])
    for column in (MASS, RADIUS):
        if (scenes[..., column] <= 0.0).any():
            scene, disk = (int(i) for i in np.argwhere(scenes[..., column] <= 0.0)[0])
            raise InvalidInputError(
                f"{STATE_NAMES[column]} of disk {disk} in scene {scene} is"
                f" {scenes[scene, disk, column]}; it must be positive"
            )


def _check_pushed(pushed: np.ndarray, count: int) -> None:
    wrong = ~np.isin(pushed, np.arange(count))
    if wrong.any():
        index = int(np.argmax(wrong))
        raise InvalidInputError(
            f"push {index} is against body {pushed[index]:g};"
            f" the scenes have bodies 0 to {count - 1}"
        )


def check_finite(name: str, values: np.ndarray) -> None:
    """Check that values are finite.

    Raises:
        InvalidInputError: naming the first that is not.
    """
    if not np.isfinite(values).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise InvalidInputError(f"{name}{list(where)} is {values[where]}; it must be finite")


def check_physics_next(scenes: np.ndarray, physics_next: np.ndarray) -> None:
    """Check that a prediction is one of these scenes.

    Raises:
        InvalidInputError: it has another shape.
    """
    if physics_next.shape != scenes.shape:
        raise InvalidInputError(
            f"physics_next has shape {scenes.shape} like the scenes, not {physics_next.shape}"
        )
