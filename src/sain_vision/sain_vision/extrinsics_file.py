"""The YAML file of a calibration: where a camera is, and how well that is known."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import check_numbers, check_text
from sain_core.errors import ConfigError, InvalidInputError
from sain_core.guarding.documents import dump_yaml, read_user_yaml
from sain_core.guarding.untrusted import check_frame
from sain_core.output import write_whole
from sain_core.wire import Turn, check_pose
from sain_vision.optics import CameraModel, check_view, rotation_of, sees_table

KEYS: Final = ("frame", "parent", "place", "turn")
WORLD: Final = "world"
FARTHEST: Final = 10.0  # [m]
WIDE: Final = CameraModel(  # sees 60 degrees to each side: what it does not, no usual lens does
    101,
    101,
    np.array([[29.0, 0, 50], [0, 29.0, 50], [0, 0, 1]]),
    np.zeros(5),
    np.eye(3),
    np.zeros(3),
)


@dataclass(frozen=True, eq=False)
class Extrinsics:
    """The pose of a camera."""

    frame: str  # its optical frame
    parent: str  # the frame that the pose is in
    place: Float[ndarray, "3"]  # (3,) [m]
    turn: Turn  # (4,) quaternion x y z w

    def placed(self, camera: CameraModel) -> CameraModel:
        """Return a camera at this pose in the world.

        Raises `InvalidInputError`: the pose is in another frame, or no point of the table is seen.
        """
        if self.parent != WORLD:
            raise InvalidInputError(
                f"the pose of {self.frame!r} is in the frame {self.parent!r}; it must be in"
                f" {WORLD!r}: there is no /tf here"
            )
        placed = self.of(camera)
        check_view(placed, f"the camera {self.frame!r}")
        return placed

    def of(self, camera: CameraModel) -> CameraModel:
        """Return a camera at this pose, in the frame that the pose is in."""
        return camera.moved(rotation_of(self.turn), self.place)


def write_extrinsics(path: Path, pose: Extrinsics, about: Mapping[str, Any]) -> None:
    """Write a file, with what else is known of the calibration.

    Raises `OutputError`: it cannot be written.
    """
    content = {
        "frame": pose.frame,
        "parent": pose.parent,
        "place": pose.place.tolist(),
        "turn": pose.turn.tolist(),
        **about,
    }
    write_whole(path, dump_yaml(content).encode())


def read_extrinsics(path: Path, table: str = WORLD) -> Extrinsics:
    """Return the pose that a file states.

    Raises `ConfigError`: naming the file and what is wrong; also if the pose is in the frame of the
    `table`, and no usual lens would show that.
    """
    content = read_user_yaml(path, "calibration")
    if any(key not in content for key in KEYS):
        raise ConfigError(f"calibration {path} must have {', '.join(KEYS)}")
    try:
        frame, parent = (check_frame(key, check_text(key, content[key])) for key in KEYS[:2])
        if frame == parent:
            raise ConfigError(f"frame and parent are both {frame!r}; frame must be the camera's")
        place = check_numbers("place", content["place"], 3, FARTHEST, "m")
        turn = check_numbers("turn", content["turn"], 4)
        pose = Extrinsics(frame, parent, *check_pose(place, turn, "the pose"))
        if parent == table:
            turned = replace(pose, turn=np.roll(pose.turn, -1))
            hint = ": as w x y z, this turn would show it" if sees_table(turned.of(WIDE)) else ""
            check_view(pose.of(WIDE), f"the camera {frame!r}", hint)
    except (ConfigError, InvalidInputError) as error:
        raise ConfigError(f"calibration {path}: {error}") from error
    return pose
