"""From arrays to messages: the one encoder of every node. The decoder is `sain_core.wire`.

Float arrays cross as ``array.array``: `rclpy` copies that in one go, while a list or an ndarray
is checked number by number (20 times slower for 100,000 doubles). Doubles arrive bit for bit.
"""

from array import array

import numpy as np
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from sain_core.history import PushHistory
from sain_core.push import PUSH_NAMES
from sain_core.scene import STATE_NAMES
from sain_core.types import Points, PushArray, Pushes, Scene, Scenes
from sain_interfaces.msg import DiskState, Goal, Plan, Push
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import PredictResidual, Rollout

WORLD_FRAME = "world"


def encode_floats(values: np.ndarray) -> "array[float]":
    """Return an array of any shape as flat, row-major doubles."""
    flat = array("d")
    flat.frombytes(np.ascontiguousarray(values, dtype=np.float64).tobytes())
    return flat


def encode_time(nanoseconds: int) -> Time:
    """Return a time stamp."""
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def header(stamp: Time) -> Header:
    """Return a header in the frame ``world``."""
    return Header(stamp=stamp, frame_id=WORLD_FRAME)


def encode_disks(scene: Scene) -> list[DiskState]:
    """Return a scene (N, 8) as ``DiskState[]``."""
    return [DiskState(**dict(zip(STATE_NAMES, row, strict=True))) for row in scene.tolist()]


def encode_scene(
    scene: Scene, *, stamp: Time, episode_id: int, scene_id: int, settled: bool
) -> SceneMessage:
    """Return a scene (N, 8) with the ids that a push names it by."""
    return SceneMessage(
        header=header(stamp),
        episode_id=episode_id,
        scene_id=scene_id,
        settled=settled,
        disks=encode_disks(scene),
    )


def encode_push(
    push: PushArray, *, stamp: Time, push_id: int, episode_id: int, scene_id: int, source: str
) -> Push:
    """Return a push (3,) with its id and those of the scene that it was planned from."""
    return Push(
        header=header(stamp),
        push_id=push_id,
        episode_id=episode_id,
        scene_id=scene_id,
        source=source,
        **dict(zip(PUSH_NAMES, push.tolist(), strict=True)),
    )


def encode_goal(
    goal: Points,
    *,
    stamp: Time,
    goal_id: int,
    episode_id: int = 0,
    tolerance: float,
    max_pushes: int = 0,
) -> Goal:
    """Return a goal (2,) [m]; episode 0 is any, 0 pushes is no limit."""
    x, y = goal.tolist()
    return Goal(
        header=header(stamp),
        goal_id=goal_id,
        episode_id=episode_id,
        x=x,
        y=y,
        tolerance=tolerance,
        max_pushes=max_pushes,
    )


def fill_past(request: Rollout.Request | PredictResidual.Request, history: PushHistory) -> None:
    """Put an episode's earlier pushes into a request about scenes with as many disks."""
    request.past = len(history)
    request.past_scenes = encode_floats(history.state)
    request.past_pushes = encode_floats(history.action)
    request.past_next = encode_floats(history.next_state)


def fill_plan(message: Plan, pushes: Pushes, predicted: Scenes) -> None:
    """Put the pushes (H, 3) and the scenes (H, N, 8) that they should lead to into a plan."""
    message.horizon, message.disks = predicted.shape[:2]
    message.pushes = encode_floats(pushes)
    message.predicted = encode_floats(predicted)
