# ruff: noqa: E501 - a case is a line
"""The YAML file of bodies: what is refused, and in which words."""

from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.body_file import BodyFile, read_bodies, write_tagged_bodies
from sain_core.shapes.library import get_shape, own_bodies
from sain_core.shapes.shape import FLAT
from tests.sain_core.shapes.test_outlines import a_bar, objects

TWO = """
bodies:
  - {name: mug, shape: disk, role: pushable, radius: 0.05, mass: 0.4, frame: tag_7}
  - {shape: t, role: movable, radius: 0.1, mass: unknown, frame: tag_9}
"""


def read(folder: Path, text: str) -> BodyFile:
    path = folder / "bodies.yaml"
    path.write_text(text)
    return read_bodies(path)


def test_everything_of_a_body_is_read(tmp_path):
    file = read(tmp_path, TWO)
    assert [shape.name for shape in file.bodies.shapes] == ["disk", "t"]
    assert file.bodies.roles == (Role.PUSHABLE, Role.MOVABLE)
    assert (file.names, file.frames) == (("mug", "t"), ("tag_7", "tag_9"))
    assert (file.radii, file.masses, file.weighed) == ((0.05, 0.1), (0.4, 8.0), False)
    scene = file.scene(np.array([[0.4, 0.1, 0.0], [0.6, 0.0, 1.0]]))
    assert scene.shape == (2, 8)
    assert scene[1].tolist() == [0.6, 0.0, 1.0, 0.0, 0.0, 0.0, 8.0, 0.1]
    assert file.called(0) == "body 0 (mug)"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bodies: []", "it must have a list 'bodies' of 1 to 32 bodies"),
        ("- 1", r"is not read: it has \[1\]; it must have keys"),
        ("bodies: [3]", "body 0 is 3; it must have keys: name, shape"),
        ("bodies: [{shape: disk}]", "body 0 has no radius; it needs shape and radius"),
        ("bodies: [{shape: disk, radus: 0.1}]", r"body 0 has the key 'radus' \(did you mean 'radius'\?\)"),
        ("bodies: [{shape: disk, radius: 50}]", "radius of body 0 is 50; allowed: 0.001 to 0.5 m"),
        ("bodies: [{shape: disk, radius: 0.1, mass: light}]", "mass of body 0 is 'light'; allowed"),
        ("bodies: [{shape: disk, radius: 0.1, role: fixed}]", "no body is pushable"),
        (
            "bodies: [{shape: disk, radius: 0.1, role: pushable}, {shape: disk, radius: 0.1}]",
            "body 1 has no role and others have",
        ),
        ("bodies: [{shape: disk, radius: 0.1, tags: [{size: 1}]}]", "a tag of body 0 has no id"),
        ("bodies: [{shape: disk, radius: 0.1, tags: 5000}]", "id of a tag of body 0 is 5000; allow"),
        (
            "bodies: [{shape: disk, radius: 0.1, tags: 3}, {shape: t, radius: 0.1, tags: [1, 3]}]",
            "tag 3 is on bodies 0 and 1; each tag may be given once",
        ),
        (
            "bodies: [{shape: disk, radius: 0.1, frame: a}, {shape: t, radius: 0.1, frame: a}]",
            "two bodies have the frame 'a'",
        ),
        ("bodies: [{shape: disk, radius: 1:30}]", "radius of body 0 is '1:30'; allowed: 0.001"),
        ("bodies: [{shape: disk, radius: 0.1, topic: a b}]", "topic of body 0 is 'a b'; a name in ROS has letters"),
        ("bodies: [{shape: disk, radius: 0.1, topic: 3d/pose}]", "topic of body 0 is '3d/pose'; "),
        ("bodies: [{shape: disk, radius: 0.1, frame: a b}]", "frame of body 0 is 'a b'; it must"),
        ("bodies: [{shape: disk, radius: 0.1, frame: /a}]", "frame of body 0 is '/a'; it must not"),
        ("bodies: [{shape: disk, radius: 0.1, tags: [1, 1]}]", "tag 1 is twice on body 0; each"),
        (
            "bodies: [{shape: t, radius: 0.1}, {shape: t, radius: 0.1},"
            " {shape: t, radius: 0.1, name: t_1}]",
            "two bodies have the name 't_1'; each needs its own",
        ),
        ("bodies: [{shape: disk, radius: 0.1, tags: 1.0}]", "1.0; allowed: whole numbers, 0 to 586"),
        (
            "bodies: [{shape: disk, radius: 0.1, tags: [{id: 1, size: 0.3}]}]",
            "tag 1 of body 0 has a side of 0.3 m and the body is 0.2 m across; it must lie on",
        ),
        (
            "bodies: [{shape: disk, radius: 0.1, tags: [{id: 1, x: 0.2}]}]",
            r"tag 1 of body 0 is at \(0.2, 0\) m, beside the body of radius 0.1 m; its centre must",
        ),
        (
            "bodies: [{shape: disk, radius: 0.1, tags: [1, {id: 2, size: 0.02, x: 0.025}]}]",
            "tag 2 of body 0 lies where its tag 1 does; tags must be apart: correct x, y and size",
        ),
        ("bodies: [{shape: 'disk:Flat', radius: 0.1}]", r"did you mean 'disk:flat'\?"),
        ("bodies: [{shape: box, radius: 0.1}]", r"shape of body 0 is 'box' \(did you mean 'box_"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(tmp_path, text, message):
    with pytest.raises(ConfigError, match=rf"bodies file .*bodies\.yaml.*{message}"):
        read(tmp_path, text)


def test_radius_and_mass_may_have_an_exponent(tmp_path):
    bodies = read(tmp_path, "bodies: [{shape: disk, radius: 8e-2, mass: 1e0, topic: /mocap/a_1}]")
    assert (bodies.radii, bodies.masses, bodies.topics) == ((0.08,), (1.0,), ("/mocap/a_1",))


def test_a_file_that_is_written_is_read_back_with_shapes_of_a_file(tmp_path):
    (name, one), *_ = own_bodies(objects(tmp_path, a_bar())).items()
    bodies = Bodies((one.shape.on(FLAT), get_shape("t:flat")), heights=(0.06, 0.04))
    scene = make_scene(np.zeros((2, 2)), np.full(2, 1.0), np.array([one.radius, 0.1]))
    path, sources = tmp_path / "bodies.yaml", {one.shape.name: f"{tmp_path}/objects.json:{name}"}
    write_tagged_bodies(path, scene, bodies, sources)
    read = read_bodies(path)
    assert (read.bodies.shapes, read.heights) == (bodies.shapes, bodies.tops)
    assert (read.radii, read.masses) == (tuple(scene[:, 7]), (1.0, 1.0))
