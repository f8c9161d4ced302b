"""Meshes of links: read once, and again when their file changes."""

import pytest
import trimesh

from sain_core import scratch
from sain_core.errors import ConfigError
from sain_live.page.arm import read_mesh

GREY = (210, 212, 215)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scratch.cache_folder.cache_clear()
    yield tmp_path / "cache" / "sain" / "meshes"
    scratch.cache_folder.cache_clear()


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
