"""From messages to arrays: the one decoder of everything that crosses the wire.

Messages are read by their attributes and never by their class, so the same code decodes what
`rclpy` delivers, and what a bag holds when it is read without ROS. Each function checks the
dimensions that the message states and that every number is finite. The encoder is
`sain_core.ros.codec`.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import atan2, isfinite, pi, prod
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError
from sain_core.feasibility import ReachTable
from sain_core.goal import KEEP_TOLERANCE, TOLERANCE, TURN_PER_METRE, BodyPose, Goal
from sain_core.guarding.untrusted import LEAST_RADIUS, MOST_BODIES, MOST_RADIUS
from sain_core.push import BODY, DEFAULT_SPEED, PUSH_NAMES, PUSH_SIZE, SPEED
from sain_core.scene import STATE_NAMES, STATE_SIZE, THETA, check_finite
from sain_core.shapes.outlines import MOST_MASS
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, PushArray, Pushes, PushSequences, Scene, Scenes

MIN_DISKS = 1
UNIT: Final = 0.01  # by which the length of a quaternion may be off
LEAST_CELL, MOST_CELL = 0.001, 0.2  # [m], of a table of reach
MOST_CELLS: Final = 100_000
FRAMES: Final = ("", "world")  # of a scene
RANGES: Final = np.array(  # of the numbers of a body, far wider than those of any table
    [(-10.0, 10.0)] * 2
    + [(-2 * pi, 2 * pi)]
    + [(-100.0, 100.0)] * 3
    + [(1e-6, MOST_MASS), (LEAST_RADIUS, MOST_RADIUS)]
)
UNITS: Final = ("m", "m", "rad", "m/s", "m/s", "rad/s", "kg", "m")
UPRIGHT: Final = 0.9  # cosine of the largest tilt of a body, 25 degrees
UPWARDS: Final = "; its z axis must point up"
TIPPED: Final = ": it has tipped over; stand it up again, or correct its frame: z must point up"
Place = Float[ndarray, "3"]
Turn = Float[ndarray, "4"]  # quaternion x y z w


def decode_stamp(stamp: Any) -> int:
    """Return a time stamp, a ``builtin_interfaces/Time``, in nanoseconds."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def decode_disks(disks: Sequence[Any], name: str = "scene") -> Scene:
    """Return ``DiskState[]`` as a scene (N, 8); raises `InvalidInputError`: no disk, NaN or Inf."""
    values = [[getattr(disk, column) for column in STATE_NAMES] for disk in disks]
    return check_disks(np.array(values, dtype=np.float64).reshape(-1, STATE_SIZE), name)


def check_disks(scene: Scene, name: str = "scene") -> Scene:
    """Return a scene (N, 8) that came over the wire, with a disk and of finite numbers."""
    if len(scene) < MIN_DISKS:
        raise InvalidInputError(f"{name} has {len(scene)} disks; it needs at least {MIN_DISKS}")
    check_finite(scene, STATE_NAMES, f"{name}: {{name}} of disk {{row}}")
    return scene


def decode_scene(message: Any) -> Scene:
    """Return the bodies (N, 8) of a ``Scene`` by which a robot may be moved."""
    frame, stamp = message.header.frame_id, message.header.stamp
    if frame not in FRAMES:
        raise InvalidInputError(f"the scene is in frame {frame[:64]!r}; it must be in 'world'")
    if stamp.sec < 0 or stamp.nanosec >= 10**9:
        raise InvalidInputError(
            f"the stamp of the scene is {stamp.sec} s and {stamp.nanosec} ns; allowed: from 0 s,"
            f" and 0 to {10**9 - 1} ns"
        )
    return check_bodies(decode_disks(message.disks))


def check_bodies(scene: Scene, name: str = "scene") -> Scene:
    """Return a finite scene (N, 8) when each number can be one of a body on a table."""
    low, high = RANGES.T
    wrong = (scene < low) | (scene > high)
    if wrong.any():
        body, column = (int(index) for index in np.argwhere(wrong)[0])
        value, unit = scene[body, column], UNITS[column]
        hint = "; it looks like degrees" if column == THETA and abs(value) <= 360.0 else ""
        raise InvalidInputError(
            f"{name}: {STATE_NAMES[column]} of body {body} is {value:g} {unit}; allowed:"
            f" {low[column]:g} to {high[column]:g} {unit}{hint}"
        )
    return scene


def decode_push(message: Any) -> PushArray:
    """Return a ``Push`` as an array (5,); a speed of 0, as of a field left out, is the default."""
    push = push_as_sent(message)
    check_finite(push, PUSH_NAMES, "{name} of the push")
    return push


def push_as_sent(message: Any) -> PushArray:
    """Return a ``Push`` as an array (5,), whatever it holds: one that was refused may hold NaN."""
    return as_sent(np.array([getattr(message, name) for name in PUSH_NAMES], dtype=np.float64))


def as_sent(numbers: Pushes) -> Pushes:
    """Return the numbers of messages ``Push`` (..., 5) as pushes: a speed of 0 is the default."""
    pushes = numbers.copy()
    pushes[..., SPEED] = np.where(numbers[..., SPEED] == 0.0, DEFAULT_SPEED, numbers[..., SPEED])
    return pushes


def decode_goal(message: Any) -> Goal:
    """Return what a ``Goal``, received or recorded, asks for; a tolerance of 0 is the default."""
    poses = message.poses
    if len(poses) > MOST_BODIES:
        raise InvalidInputError(f"the goal has {len(poses)} poses; at most {MOST_BODIES} may be")
    keep = tuple(int(body) for body in message.keep)
    tolerance = message.keep_tolerance or KEEP_TOLERANCE
    return Goal(tuple(map(_decode_goal_pose, poses)), keep, float(tolerance))


def _decode_goal_pose(message: Any) -> BodyPose:
    body, tolerance = int(message.body), message.tolerance or TOLERANCE
    place = BodyPose(body, float(message.x), float(message.y), tolerance=float(tolerance))
    if not message.has_heading:
        return place
    turn = message.heading_tolerance or TURN_PER_METRE * tolerance
    return replace(place, heading=float(message.heading), heading_tolerance=float(turn))


def decode_pose(message: Any, what: str, remedy: str = UPWARDS) -> Float[ndarray, "3"]:
    """Return x, y and heading (3,) of a ``Pose`` on the table; raises as the two that follow."""
    return flat_pose(*check_pose(*_pose_numbers(message), what), what, remedy)


def _pose_numbers(message: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    place, turn = message.position, message.orientation
    return (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)


def check_pose(place: Sequence[float], turn: Sequence[float], what: str) -> tuple[Place, Turn]:
    """Return a place (3,) [m] and a unit quaternion (4,), if they can be such."""
    if not all(map(isfinite, (*place, *turn))):
        raise InvalidInputError(f"{what} has a number that is NaN or Inf; all must be finite")
    size = float(np.linalg.norm(turn))
    if abs(size - 1.0) > UNIT:
        raise InvalidInputError(
            f"{what} has a quaternion of length {size:.3g}; it must be 1 (x y z w)"
        )
    return np.array(place), np.array(turn) / size


def flat_pose(place: Place, turn: Turn, what: str, remedy: str = UPWARDS) -> Float[ndarray, "3"]:
    """Return x, y and heading (3,) of a body whose z axis points up.

    Raises `InvalidInputError`: it is tilted; with the remedy.
    """
    x, y, z, w = turn.tolist()
    upright = 1.0 - 2.0 * (x * x + y * y)
    if upright < UPRIGHT:
        tilt = np.degrees(np.arccos(np.clip(upright, -1.0, 1.0)))
        raise InvalidInputError(f"{what} is tilted by {tilt:.0f} degrees{remedy}")
    heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.array([place[0], place[1], heading])


def decode_reach(message: Any) -> ReachTable:
    """Return an ``OccupancyGrid`` as a table of reach: 0 is a square that the tool can stand in."""
    info = message.info
    rows, columns, cell = int(info.height), int(info.width), float(info.resolution)
    x, y, turn = flat_pose(*check_pose(*_pose_numbers(info.origin), "origin"), "origin")
    if turn != 0.0 or not LEAST_CELL <= cell <= MOST_CELL:
        raise InvalidInputError(
            f"the table of reach has cells of {cell:g} m and is turned by {turn:g} rad; allowed:"
            f" {LEAST_CELL:g} to {MOST_CELL:g} m, and no turn"
        )
    if rows * columns != len(message.data) or rows * columns > MOST_CELLS:
        raise InvalidInputError(
            f"the table of reach states {rows} x {columns} cells and has {len(message.data)};"
            f" allowed: as many as stated, at most {MOST_CELLS}"
        )
    free = np.asarray(message.data, dtype=np.int8).reshape(rows, columns) == 0
    return ReachTable.of((float(x), float(y)), cell, free)


def decode_plan(message: Any) -> tuple[Pushes, Scenes]:
    """Return the pushes (H, 5) of a ``Plan`` and the scenes (H, N, 8) that it expects.

    A plan that sends no push has H = 0.
    """
    horizon, disks = message.horizon, message.disks
    pushes = _decode_pushes(message.pushes, (horizon,), "pushes of the plan", disks)
    predicted = decode_floats(
        message.predicted, (horizon, disks, STATE_SIZE), "predicted scenes of the plan"
    )
    return pushes, predicted


def decode_rollout_request(request: Any) -> tuple[Scene, PushSequences]:
    """Return scene (N, 8) and sequences (K, H, 5) of a ``Rollout`` request."""
    samples, horizon, disks = request.samples, request.horizon, request.disks
    _at_least(samples, 1, "samples")
    _at_least(horizon, 1, "horizon")
    _at_least(disks, MIN_DISKS, "disks")
    scene = decode_floats(request.scene, (disks, STATE_SIZE), "scene")
    return scene, _decode_pushes(request.pushes, (samples, horizon), "pushes", disks)


def decode_predict_request(request: Any) -> tuple[Scenes, Pushes, Scenes | None]:
    """Return scenes (B, N, 8), pushes (B, 5) and, if given, f_p(s, a) (B, N, 8)."""
    batch, disks = request.batch, request.disks
    _at_least(batch, 1, "batch")
    _at_least(disks, MIN_DISKS, "disks")
    shape = (batch, disks, STATE_SIZE)
    scenes = decode_floats(request.scenes, shape, "scenes")
    pushes = _decode_pushes(request.pushes, (batch,), "pushes", disks)
    if len(request.physics_next) == 0:
        return scenes, pushes, None
    return scenes, pushes, decode_floats(request.physics_next, shape, "physics_next")


def decode_past(request: Any) -> PushHistory:
    """Return the earlier pushes that a ``Rollout`` or ``PredictResidual`` request tells of."""
    past, disks, noise = request.past, request.disks, request.past_noise
    _at_least(disks, MIN_DISKS, "disks")
    shape = (past, disks, STATE_SIZE)
    scenes = decode_floats(request.past_scenes, shape, "past_scenes")
    return PushHistory(
        scenes,
        _decode_pushes(request.past_pushes, (past,), "past_pushes", disks),
        decode_floats(request.past_next, shape, "past_next"),
        decode_floats(noise, (past, disks), "past_noise") if len(noise) else None,
    )


def decode_result(message: Any) -> tuple[Scene, PushArray, Scene]:
    """Return the scene (N, 8) before a ``PushResult``, its push, and the scene after it."""
    before = decode_disks(message.before.disks, "scene before the push")
    after = decode_disks(message.after.disks, "scene after the push")
    if len(before) != len(after):
        raise InvalidInputError(f"a push led from {len(before)} disks to {len(after)}; it cannot")
    return before, decode_push(message.push), after


def decode_rollout(response: Any, shape: tuple[int, int, int]) -> PredictedScenes:
    """Return the predicted scenes (K, H, N, 8) of a ``Rollout`` reply that should be (K, H, N)."""
    return decode_floats(response.predicted, (*shape, STATE_SIZE), "predicted")


def decode_floats(values: Sequence[float], shape: tuple[int, ...], name: str) -> ndarray:
    """Return a flat, row-major ``float64[]`` in its shape, finite."""
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


def _decode_pushes(
    values: Sequence[float], shape: tuple[int, ...], name: str, bodies: int
) -> ndarray:
    """Return pushes (*shape, 5) against so many bodies."""
    pushes = decode_floats(values, (*shape, PUSH_SIZE), name)
    body = pushes[..., BODY]
    wrong = (body < 0) | (body >= bodies) | (body % 1.0 != 0.0)
    if wrong.any():
        raise InvalidInputError(
            f"{name} names body {body[wrong][0]:g}; there are bodies 0 to {bodies - 1}"
        )
    return pushes


def _at_least(value: int, minimum: int, name: str) -> None:
    if value < minimum:
        raise InvalidInputError(f"{name} is {value}; it must be at least {minimum}")
