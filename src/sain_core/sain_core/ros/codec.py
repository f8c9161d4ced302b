"""From arrays to messages: the one encoder of every node. The decoder is `sain_core.wire`.

Float arrays cross as ``array.array``: `rclpy` copies that in one go, while a list or an ndarray
is checked number by number (20 times slower for 100,000 doubles). Doubles arrive bit for bit.
"""

from array import array
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Point32, Polygon, Pose, PoseWithCovariance, Quaternion
from nav_msgs.msg import MapMetaData, OccupancyGrid
from sensor_msgs.msg import Image
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header

from sain_core.feasibility import ReachTable
from sain_core.goal import BodyPose, Goal
from sain_core.push import BODY, PUSH_NAMES
from sain_core.scene import DISK_HEIGHT, STATE_NAMES, THETA, X, Y
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.solids import support_points
from sain_core.transitions import PushHistory
from sain_core.types import PushArray, Pushes, Scalars, Scene, Scenes
from sain_core.wire.bodies import stated_parts
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_interfaces.msg import Body, DiskState, GoalPose, Plan, Push
from sain_interfaces.msg import Goal as GoalMessage
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import PredictResidual, Rollout

WORLD_FRAME = "world"


def encode_floats(values: np.ndarray) -> "array[float]":
    """Return an array of any shape as flat, row-major doubles."""
    flat = array("d")
    flat.frombytes(np.ascontiguousarray(values, dtype=np.float64).reshape(-1).view(np.uint8).data)
    return flat


def encode_time(nanoseconds: int) -> Time:
    """Return a time stamp."""
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def decode_time(stamp: Any) -> float:
    """Return a time stamp, received or recorded, in seconds."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def header(stamp: Time) -> Header:
    """Return a header in the frame ``world``."""
    return Header(stamp=stamp, frame_id=WORLD_FRAME)


def encode_image(pixels: np.ndarray, encoding: str, header: Header) -> Image:
    """Return an image (height, width) or (height, width, channels) as a message."""
    rows = np.ascontiguousarray(pixels)
    data = array("B")
    data.frombytes(rows.data.cast("B"))  # a list would take a second
    height, width = rows.shape[:2]
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        step=rows.strides[0],
        data=data,
    )


def encode_disks(scene: Scene) -> list[DiskState]:
    """Return a scene (N, 8) as ``DiskState[]``."""
    return [DiskState(**dict(zip(STATE_NAMES, row, strict=True))) for row in scene.tolist()]


def encode_reach(reach: ReachTable, stamp: Time) -> OccupancyGrid:
    """Return a table of reach as a map: 0 is in reach, 100 is not."""
    message = OccupancyGrid(header=header(stamp))
    rows, columns = reach.free.shape
    x, y = map(float, reach.corner)
    message.info = MapMetaData(map_load_time=stamp, resolution=reach.cell, width=columns)
    message.info.height, message.info.origin = rows, Pose(position=Point(x=x, y=y))
    message.data = array("b", np.where(reach.free, 0, 100).astype(np.int8).tobytes())
    return message


def encode_poses(scene: Scene, places: Scalars, turns: Scalars) -> list[PoseWithCovariance]:
    """Return the poses of a scene (N, 8), with standard deviations (N,) [m] and (N,) [rad]."""
    messages = []
    for body, row in enumerate(scene):
        half = row[THETA] / 2
        pose = Pose(position=Point(x=row[X], y=row[Y], z=DISK_HEIGHT / 2))
        pose.orientation = Quaternion(z=float(np.sin(half)), w=float(np.cos(half)))
        covariance = np.zeros((6, 6))  # x y z, turns about x y z
        covariance[[X, Y], [X, Y]] = places[body] ** 2
        covariance[5, 5] = turns[body] ** 2
        messages.append(PoseWithCovariance(pose=pose, covariance=covariance.ravel()))
    return messages


def encode_scene(
    scene: Scene, *, stamp: Time, episode_id: int, scene_id: int, settled: bool
) -> SceneMessage:
    """Return a scene (N, 8) with the ids by which pushes refer to it."""
    return SceneMessage(
        header=header(stamp),
        episode_id=episode_id,
        scene_id=scene_id,
        settled=settled,
        disks=encode_disks(scene),
    )


def encode_bodies(
    bodies: Bodies, radii: Sequence[float], *, stamp: Time, episode_id: int
) -> BodiesMessage:
    """Return shapes, roles and heights of an episode's bodies with these radii [m]."""
    messages = [
        Body(
            name=shape.name,
            role=str(role),
            radius=radius,
            symmetry=shape.symmetry,
            parts=[
                SolidPrimitive(
                    type=kind,
                    dimensions=sizes,
                    polygon=Polygon(points=[Point32(x=x, y=y) for x, y in corners.tolist()]),
                )
                for kind, sizes, corners in stated_parts(shape, radius, top)
            ],
            supports=[
                Point(x=x, y=y, z=-top / 2) for x, y in support_points(shape, radius).tolist()
            ],
        )
        for shape, role, top, radius in zip(
            bodies.shapes, bodies.roles, bodies.tops, radii, strict=True
        )
    ]
    return BodiesMessage(header=header(stamp), episode_id=episode_id, bodies=messages)


def encode_push(
    push: PushArray,
    *,
    stamp: Time,
    push_id: int,
    episode_id: int,
    scene_id: int,
    source: str,
    seen: Scene | None = None,
) -> Push:
    """Return a push (5,) with its id and those of the scene that it was planned from.

    `seen` (N, 8) is where the bodies are taken to be, where that is not where they are.
    """
    return Push(
        header=header(stamp),
        push_id=push_id,
        episode_id=episode_id,
        scene_id=scene_id,
        source=source,
        body=int(push[BODY]),
        disks=[] if seen is None else encode_disks(seen),
        **dict(zip(PUSH_NAMES[BODY + 1 :], push[BODY + 1 :].tolist(), strict=True)),
    )


def encode_goal(
    goal: Goal, *, stamp: Time, goal_id: int, episode_id: int = 0, max_pushes: int = 0
) -> GoalMessage:
    """Return a goal; episode 0 is any, 0 pushes is no limit."""
    return GoalMessage(
        header=header(stamp),
        goal_id=goal_id,
        episode_id=episode_id,
        max_pushes=max_pushes,
        poses=[_goal_pose(pose) for pose in goal.poses],
        keep=list(goal.keep),
        keep_tolerance=goal.keep_tolerance,
    )


def _goal_pose(pose: BodyPose) -> GoalPose:
    return GoalPose(
        body=pose.body,
        x=pose.x,
        y=pose.y,
        heading=pose.heading or 0.0,
        has_heading=pose.heading is not None,
        tolerance=pose.tolerance,
        heading_tolerance=pose.heading_tolerance,
    )


def fill_past(request: Rollout.Request | PredictResidual.Request, history: PushHistory) -> None:
    """Put an episode's earlier pushes into a request about scenes with as many disks."""
    request.past = len(history)
    request.past_scenes = encode_floats(history.state)
    request.past_pushes = encode_floats(history.action)
    request.past_next = encode_floats(history.next_state)
    if history.noise is not None:
        request.past_noise = encode_floats(history.noise)


def fill_bodies(request: Rollout.Request | PredictResidual.Request, bodies: Bodies) -> None:
    """Put shapes and roles into a request; the paper's disks need none."""
    if not bodies.are_paper_disks:
        request.shapes = [shape.name for shape in bodies.shapes]
        request.roles = [str(role) for role in bodies.roles]


def fill_plan(message: Plan, pushes: Pushes, predicted: Scenes) -> None:
    """Put the pushes (H, 5) and the scenes (H, N, 8) after them into a plan."""
    message.horizon, message.disks = predicted.shape[:2]
    message.pushes = encode_floats(pushes)
    message.predicted = encode_floats(predicted)
