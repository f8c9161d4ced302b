"""The YAML file of a calibration: where a camera is, and how well that is known."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.guarding.documents import dump_yaml, read_user_yaml
from sain_core.output import write_whole
from sain_core.wire import Turn, check_pose

KEYS = ("frame", "parent", "place", "turn")


@dataclass(frozen=True, eq=False)
class Extrinsics:
    """The pose of a camera.

    Attributes:
        frame: its optical frame.
        parent: the frame that the pose is in.
        place: (3,) [m].
        turn: (4,) quaternion x y z w.
    """

    frame: str
    parent: str
    place: Float[ndarray, "3"]
    turn: Turn


def write_extrinsics(path: Path, pose: Extrinsics, about: Mapping[str, Any]) -> None:
    """Write a file, with what else is known of the calibration.

    Raises:
        OutputError: it cannot be written.
    """
    content = {
        "frame": pose.frame,
        "parent": pose.parent,
        "place": pose.place.tolist(),
        "turn": pose.turn.tolist(),
        **about,
    }
    write_whole(path, dump_yaml(content).encode())


def read_extrinsics(path: Path) -> Extrinsics:
    """Return the pose that a file states.

    Raises:
        ConfigError: naming the file and what is wrong.
    """
    content = read_user_yaml(path, "calibration")
    if not isinstance(content, Mapping) or any(key not in content for key in KEYS):
        raise ConfigError(f"calibration {path} must have {', '.join(KEYS)}")
    place, turn = content["place"], content["turn"]
    for key, value, size in (("place", place, 3), ("turn", turn, 4)):
        numbers = isinstance(value, list) and all(isinstance(one, int | float) for one in value)
        if not numbers or len(value) != size:
            raise ConfigError(f"calibration {path}: {key} must be {size} numbers")
    pose = check_pose(place, turn, f"the pose in calibration {path}")
    return Extrinsics(str(content["frame"]), str(content["parent"]), *pose)
