"""The file of a camera's pose: what is refused, and in which words, also where a node reads it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sain_core.errors import ConfigError, InvalidInputError
from sain_vision.extrinsics_file import read_extrinsics, write_extrinsics
from sain_vision.optics import check_calibration
from sain_vision.ros.outline_node import OutlineNode
from sain_vision.ros.tag_node import TagNode

DOWN = [1.0, 0.0, 0.0, 0.0]  # x y z w
WXYZ = [0.1516, -0.3514, 0.8483, -0.3661]  # as it must not be written
POSE = {"frame": "cam", "parent": "world", "place": [0.6, 0.0, 1.0], "turn": DOWN}
CAMERA = check_calibration(
    640, 480, np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]), "plumb_bob", np.zeros(5)
)
UNSEEN = r"the camera 'cam' shows no point of the table \(x in \[0.16, 1.16\] m, .*"


def write(folder: Path, name: str, content: Any) -> Path:
    path = folder / name
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"place": [0.6, 0.0, -1.0]}, UNSEEN + "under the table, and looks along"),
        ({"turn": WXYZ}, UNSEEN + r"x y z w, .* in the world: as w x y z, this turn would show it"),
        ({"place": [6.0, 0.0, 1.0]}, UNSEEN + r"it is at \(6, 0\) m, 1 m above"),
        ({"place": [600, 0, 1000]}, r"place\[0\] is 600; .* 600 millimetres are 0.6 m"),
        ({"place": [True, 0, 1]}, r"place\[0\] is True; allowed: -10 to 10 m"),
        ({"place": [1, 2]}, r"place is \[1, 2\]; it must be a list of 3 numbers"),
        ({"turn": [float("nan"), 0, 0, 1]}, r"turn\[0\] is nan; allowed: finite numbers"),
        ({"turn": [0, 0, 0, 0]}, "the pose has a quaternion of length 0; it must be 1"),
        ({"frame": None}, "frame is None; it must be a text of 1 to 64 characters"),
        ({"frame": "/cam"}, "frame is '/cam'; it must not have spaces or begin with '/'"),
        ({"frame": "world"}, "frame and parent are both 'world'"),
    ],
)
def test_a_pose_that_cannot_be_is_refused(tmp_path, change, text):
    path = write(tmp_path, "camera.yaml", POSE | change)
    with pytest.raises(ConfigError, match=rf"calibration .*camera\.yaml: {text}"):
        read_extrinsics(path)


def test_poses_that_can_be_are_read(tmp_path):
    pose = read_extrinsics(write(tmp_path, "camera.yaml", POSE))
    write_extrinsics(tmp_path / "again.yaml", pose, {"error_mm": 0.3})
    again = read_extrinsics(tmp_path / "again.yaml")
    assert (again.frame, *again.place, *again.turn) == ("cam", *POSE["place"], *DOWN)
    away = POSE | {"parent": "base", "place": [0.0, 0.0, -0.1]}  # where base is, /tf says
    assert read_extrinsics(write(tmp_path, "camera.yaml", away)).parent == "base"
    with pytest.raises(InvalidInputError, match="is in the frame 'base'; it must be in 'world'"):
        read_extrinsics(tmp_path / "camera.yaml").placed(CAMERA)


@pytest.mark.parametrize("node", [TagNode, OutlineNode])
def test_a_node_does_not_start_with_a_camera_under_the_table(graph, tmp_path, node):
    bodies = write(
        tmp_path, "bodies.yaml", {"bodies": [{"shape": "disk", "radius": 0.1, "tags": 1}]}
    )
    path = write(tmp_path, "camera.yaml", POSE | {"place": [0.6, 0.0, -1.0]})
    with pytest.raises(ConfigError, match=UNSEEN + "under the table"):
        graph.start(node, bodies=str(bodies), extrinsics=str(path))


@pytest.mark.parametrize("change", [{"place": [1.8, 0, 1]}, {"turn": [0.7071068, 0, 0, 0.7071068]}])
def test_a_lens_that_misses_the_table_is_refused(tmp_path, change):
    pose = read_extrinsics(write(tmp_path, "camera.yaml", POSE | change))  # wide lenses see it
    with pytest.raises(InvalidInputError, match=UNSEEN):
        pose.placed(CAMERA)
    pose = read_extrinsics(write(tmp_path, "camera.yaml", POSE))
    assert np.allclose(pose.placed(CAMERA).place, POSE["place"])
