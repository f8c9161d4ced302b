"""The arm of the page: its links are where its model has them, and meshes as their files."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import read_robot, shipped
from sain_arm.robot.urdf import read_links, visible
from sain_core.errors import ConfigError
from sain_live.page.arm import Link, read_mesh


@pytest.mark.parametrize("name", shipped())
def test_links_are_where_the_model_has_them(name):
    robot = read_robot(name)
    joints = (robot.lower + 2.0 * robot.upper) / 3.0
    values = dict(zip(robot.joints, joints, strict=True))
    found, spec = {}, read_links(visible(robot.description))

    def walk(body, place, turn):
        found[body.name] = place
        for child in body.bodies:
            link = Link.of(child)
            at, (w, *xyz) = link.pose(values.get(link.joint, 0.0))
            walk(child, place + turn.apply(at), turn * Rotation.from_quat([*xyz, w]))

    walk(spec.worldbody, np.zeros(3), Rotation.identity())
    for link, (place, _) in ArmModel(robot).frames(joints).items():
        np.testing.assert_allclose(found[link], place, atol=1e-6, err_msg=link)


def test_parts_of_a_scene_are_where_it_has_them(tmp_path):
    scene = trimesh.Scene()
    for height in (1.0, 3.0):
        place = trimesh.transformations.translation_matrix((0, 0, height))
        scene.add_geometry(trimesh.creation.box(), transform=place)
    scene.export(tmp_path / "boxes.glb")
    vertices, _ = read_mesh(str(tmp_path / "boxes.glb"))
    assert sorted({round(float(z), 6) for z in vertices[:, 2]}) == [0.5, 1.5, 2.5, 3.5]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing.obj", "is missing or larger than"),
        ("two.txt", r"allowed: files of type .obj, .stl, .ply, .glb"),
        ("http://far.away/two.obj", "is missing or larger than"),
        ("package://nowhere/two.obj", "there is no package 'nowhere'"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path, name, message):
    where = name if "//" in name else str(tmp_path / name)
    with pytest.raises(ConfigError, match=message):
        read_mesh(where)
