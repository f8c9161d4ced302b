"""From messages to arrays: the one decoder of everything that crosses the wire.

Messages are read by their attributes and never by their class, so the same code decodes what
`rclpy` delivers, and what a bag holds when it is read without ROS. Each function checks the
dimensions that the message states and that every number is finite. The encoder is
`sain_core.ros.codec`.
"""

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.history import PushHistory
from sain_core.push import PUSH_NAMES, PUSH_SIZE
from sain_core.scene import STATE_NAMES, STATE_SIZE
from sain_core.types import (
    Points,
    PredictedScenes,
    PushArray,
    Pushes,
    PushSequences,
    Scene,
    Scenes,
)

MIN_DISKS = 2


def decode_disks(disks: Sequence[Any], name: str = "scene") -> Scene:
    """Return ``DiskState[]`` as a scene (N, 8).

    Raises:
        InvalidInputError: fewer than two disks, NaN or Inf.
    """
    values = [[getattr(disk, column) for column in STATE_NAMES] for disk in disks]
    return check_disks(np.array(values, dtype=np.float64).reshape(-1, STATE_SIZE), name)


def check_disks(scene: Scene, name: str = "scene") -> Scene:
    """Return a scene (N, 8) that came over the wire when it has the numbers of one.

    Raises:
        InvalidInputError: fewer than two disks, NaN or Inf.
    """
    if len(scene) < MIN_DISKS:
        raise InvalidInputError(f"{name} has {len(scene)} disks; it needs at least {MIN_DISKS}")
    if not np.isfinite(scene).all():
        disk, column = (int(index) for index in np.argwhere(~np.isfinite(scene))[0])
        value = scene[disk, column]
        raise InvalidInputError(
            f"{name}: {STATE_NAMES[column]} of disk {disk} is {value}; must be finite"
        )
    return scene


def decode_push(message: Any) -> PushArray:
    """Return a ``Push`` as an array (3,): location, angle, length.

    Raises:
        InvalidInputError: NaN or Inf.
    """
    return _decode_fields(message, PUSH_NAMES, "push")


def decode_goal(message: Any) -> Points:
    """Return where a ``Goal`` wants the target, (2,) [m].

    Raises:
        InvalidInputError: NaN or Inf, also in the tolerance.
    """
    return _decode_fields(message, ("x", "y", "tolerance"), "goal")[:2]


def decode_plan(message: Any) -> tuple[Pushes, Scenes]:
    """Return the pushes (H, 3) of a ``Plan`` and the scenes (H, N, 8) that it expects.

    A plan that sends no push has H = 0.
    """
    horizon, disks = message.horizon, message.disks
    pushes = decode_floats(message.pushes, (horizon, PUSH_SIZE), "pushes of the plan")
    predicted = decode_floats(
        message.predicted, (horizon, disks, STATE_SIZE), "predicted scenes of the plan"
    )
    return pushes, predicted


def decode_rollout_request(request: Any) -> tuple[Scene, PushSequences]:
    """Return the scene (N, 8) and the push sequences (K, H, 3) of a ``Rollout`` request."""
    samples, horizon, disks = request.samples, request.horizon, request.disks
    _at_least(samples, 1, "samples")
    _at_least(horizon, 1, "horizon")
    _at_least(disks, MIN_DISKS, "disks")
    scene = decode_floats(request.scene, (disks, STATE_SIZE), "scene")
    return scene, decode_floats(request.pushes, (samples, horizon, PUSH_SIZE), "pushes")


def decode_predict_request(request: Any) -> tuple[Scenes, Pushes, Scenes | None]:
    """Return scenes (B, N, 8), pushes (B, 3) and, if given, f_p(s, a) (B, N, 8)."""
    batch, disks = request.batch, request.disks
    _at_least(batch, 1, "batch")
    _at_least(disks, MIN_DISKS, "disks")
    shape = (batch, disks, STATE_SIZE)
    scenes = decode_floats(request.scenes, shape, "scenes")
    pushes = decode_floats(request.pushes, (batch, PUSH_SIZE), "pushes")
    if len(request.physics_next) == 0:
        return scenes, pushes, None
    return scenes, pushes, decode_floats(request.physics_next, shape, "physics_next")


def decode_past(request: Any) -> PushHistory:
    """Return the earlier pushes that a ``Rollout`` or ``PredictResidual`` request tells of.

    Raises:
        InvalidInputError: arrays that do not fit the dimensions, or cannot be an episode.
    """
    past, disks = request.past, request.disks
    _at_least(disks, MIN_DISKS, "disks")
    shape = (past, disks, STATE_SIZE)
    return PushHistory(
        decode_floats(request.past_scenes, shape, "past_scenes"),
        decode_floats(request.past_pushes, (past, PUSH_SIZE), "past_pushes"),
        decode_floats(request.past_next, shape, "past_next"),
    )


def decode_result(message: Any) -> tuple[Scene, PushArray, Scene]:
    """Return the scene (N, 8) before a ``PushResult``, its push (3,), and the scene after it.

    Raises:
        InvalidInputError: NaN or Inf, or scenes of different numbers of disks.
    """
    before = decode_disks(message.before.disks, "scene before the push")
    after = decode_disks(message.after.disks, "scene after the push")
    if len(before) != len(after):
        raise InvalidInputError(f"a push led from {len(before)} disks to {len(after)}; it cannot")
    return before, decode_push(message.push), after


def decode_rollout(response: Any, shape: tuple[int, int, int]) -> PredictedScenes:
    """Return the predicted scenes (K, H, N, 8) of a ``Rollout`` reply that should be (K, H, N)."""
    return decode_floats(response.predicted, (*shape, STATE_SIZE), "predicted")


def decode_floats(values: Sequence[float], shape: tuple[int, ...], name: str) -> np.ndarray:
    """Return a flat, row-major ``float64[]`` in its shape.

    Raises:
        InvalidInputError: the count does not fit the shape, NaN or Inf.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.size != prod(shape):
        raise InvalidInputError(
            f"{name} has {array.size} numbers; {prod(shape)} were expected, for shape {shape}"
        )
    array = array.reshape(shape)
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InvalidInputError(f"{name} at {index} is {array[index]}; must be finite")
    return array


def _decode_fields(message: Any, fields: tuple[str, ...], name: str) -> np.ndarray:
    values = np.array([getattr(message, field) for field in fields], dtype=np.float64)
    return check_fields(values, fields, name)


def check_fields(values: np.ndarray, fields: tuple[str, ...], name: str) -> np.ndarray:
    """Return numbers that came over the wire, one a field, when they are finite.

    Raises:
        InvalidInputError: one is NaN or Inf.
    """
    for field, value in zip(fields, values, strict=True):
        if not np.isfinite(value):
            raise InvalidInputError(f"{field} of the {name} is {value}; must be finite")
    return values


def _at_least(value: int, minimum: int, name: str) -> None:
    if value < minimum:
        raise InvalidInputError(f"{name} is {value}; it must be at least {minimum}")
