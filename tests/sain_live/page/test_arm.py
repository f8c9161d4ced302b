"""Meshes of links: read once, and again when their file changes."""

import sys

import numpy as np
import pytest
import trimesh

from sain_core import scratch
from sain_core.errors import ConfigError
from sain_live.page.arm import Mesh, read_mesh

GREY = (210, 212, 215)
TWO_COLOURS = """mtllib two.mtl
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
v 1 0 1
v 0 1 1
usemtl red
f 1 2 3
usemtl blue
f 4 5 6
"""
MATERIALS = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scratch.cache_folder.cache_clear()
    yield tmp_path / "cache" / "sain" / "meshes"
    scratch.cache_folder.cache_clear()


@pytest.fixture
def two(tmp_path):
    (tmp_path / "two.mtl").write_text(MATERIALS)
    (tmp_path / "two.obj").write_text(TWO_COLOURS)
    return tmp_path / "two.obj"


def heights(parts: list[Mesh]) -> dict[tuple[int, int, int], float]:
    """Return the mean height of the triangles of each colour."""
    return {part.colour: float(part.vertices[part.faces][..., 2].mean()) for part in parts}


def without_trimesh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)


def test_the_second_time_it_is_not_read_from_its_file(two, monkeypatch):
    first = read_mesh(str(two), GREY, own=True)
    without_trimesh(monkeypatch)
    second = read_mesh(str(two), GREY, own=True)
    assert heights(second) == heights(first)
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)


def test_parts_of_a_scene_are_where_it_has_them(tmp_path):
    scene = trimesh.Scene()
    for height in (1.0, 3.0):
        place = trimesh.transformations.translation_matrix((0, 0, height))
        scene.add_geometry(trimesh.creation.box(), transform=place)
    scene.export(tmp_path / "boxes.glb")
    (part,) = read_mesh(str(tmp_path / "boxes.glb"), GREY, own=False)
    assert sorted({round(float(z), 6) for z in part.vertices[:, 2]}) == [0.5, 1.5, 2.5, 3.5]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing.obj", "is missing or larger than"),
        ("two.txt", r"allowed: files of type .obj, .stl, .ply, .glb"),
        ("http://far.away/two.obj", "allowed: files of type"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path, name, message):
    where = name if "//" in name else str(tmp_path / name)
    with pytest.raises(ConfigError, match=message):
        read_mesh(where, GREY, own=True)
