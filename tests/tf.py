"""What tf2 keeps of transforms: the tree of frames, without interpolation."""

from typing import Any

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation
from tf2_msgs.msg import TFMessage


class Buffer:
    """The latest transform of each frame. Like tf2 it drops data that are not newer."""

    def __init__(self) -> None:
        self.latest: dict[str, Any] = {}
        self.problems: list[str] = []

    def receive(self, message: TFMessage) -> None:
        for transform in message.transforms:
            child, stamp = transform.child_frame_id, seconds(transform)
            last = self.latest.get(child)
            if last is not None and stamp <= seconds(last):
                self.problems.append(f"TF_REPEATED_DATA or TF_OLD_DATA of {child} at {stamp} s")
                continue
            if last is not None and last.header.frame_id != transform.header.frame_id:
                self.problems.append(f"{child} has two parents")
            self.latest[child] = transform

    def connects(self, frame: str, world: str = "world") -> bool:
        """Whether every transform from the world to a frame has arrived."""
        while frame != world and frame in self.latest:
            frame = self.latest[frame].header.frame_id
        return frame == world

    def lookup(self, frame: str, world: str = "world") -> ndarray:
        """Return the pose (4, 4) of a frame in the world."""
        pose = np.eye(4)
        while frame != world:
            moved = self.latest[frame].transform
            step = np.eye(4)
            turn, place = moved.rotation, moved.translation
            step[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
            step[:3, 3] = place.x, place.y, place.z
            pose, frame = step @ pose, self.latest[frame].header.frame_id
        return pose


def seconds(transform: Any) -> float:
    stamp = transform.header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec)
