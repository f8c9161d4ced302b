"""Bodies of meshes: what a person has from a scanner or a CAD program."""

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from sain_core.errors import DatasetError
from sain_core.shapes.meshes import read_mesh
from sain_core.shapes.outlines import trace

BOX = trimesh.creation.box((0.10, 0.06, 0.04))
T = trimesh.util.concatenate(
    [BOX, trimesh.creation.box((0.02, 0.10, 0.04)).apply_translation((0.0, -0.05, 0.0))]
)


def written(folder, mesh, name="part.stl"):
    path = folder / name
    mesh.export(path)
    return path


@pytest.mark.parametrize("name", ["part.stl", "part.obj", "part.ply", "PART.STL"])
def test_a_box_is_what_it_measures(tmp_path, name):
    path = tmp_path / name
    BOX.copy().apply_translation((3.0, -2.0, 1.0)).export(path, file_type=name[-3:].lower())
    found = read_mesh(path, "box", density=500.0)
    body = found.body
    assert sorted(np.ptp(body.shape.outline(body.radius), axis=0)) == pytest.approx([0.06, 0.10])
    assert body.centre == pytest.approx((3.0, -2.0), abs=1e-5)
    assert body.height == pytest.approx(0.04) and body.mass == pytest.approx(0.12, rel=1e-4)
    assert body.mass_centre == pytest.approx((0.0, 0.0), abs=2e-5)
    assert body.fair == "yes" and body.mended == ()
    assert found.steady == pytest.approx(0.03 / 0.02, rel=1e-3)


def test_parts_that_overlap_are_one_outline(tmp_path):
    body = read_mesh(written(tmp_path, T), "t").body
    outline = Polygon(body.shape.outline(body.radius))
    assert len(outline.exterior.coords) - 1 == 8
    assert outline.area == pytest.approx(0.1 * 0.06 + 0.02 * 0.07, rel=1e-3)


def test_the_axis_that_points_upwards_can_be_named(tmp_path):
    path = written(tmp_path, T)
    for up, sides in (("x", [0.04, 0.13]), ("y", [0.04, 0.10]), ("-z", [0.10, 0.13])):
        found = read_mesh(path, "t", up=up).body
        assert sorted(np.ptp(found.shape.outline(found.radius), axis=0)) == pytest.approx(sides)
    plain, down = (read_mesh(path, "t", up=up).body for up in ("z", "-z"))
    mirrored = trace("t", plain.shape.outline(plain.radius) * (1.0, -1.0))
    assert Polygon(down.shape.outline(1.0)).symmetric_difference(
        Polygon(mirrored.shape.outline(1.0))
    ).area == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("mesh", "fair", "area"),
    [
        (trimesh.creation.cylinder(0.05, 0.1), "yes", np.pi * 0.05**2),
        (trimesh.creation.torus(0.06, 0.02), "yes", np.pi * 0.08**2),
        (trimesh.creation.cone(0.05, 0.1), "no", np.pi * 0.05**2),
        (trimesh.creation.icosphere(radius=0.05), "no", np.pi * 0.05**2),
    ],
)
def test_slices_say_whether_a_flat_body_is_a_fair_one(tmp_path, mesh, fair, area):
    found = read_mesh(written(tmp_path, mesh), "mine")
    body = found.body
    assert body.fair == fair and Polygon(body.shape.outline(body.radius)).area == pytest.approx(
        area, rel=0.03
    )


def test_a_hole_is_filled_with_a_word(tmp_path):
    body = read_mesh(written(tmp_path, trimesh.creation.annulus(0.03, 0.06, 0.05)), "ring").body
    assert body.mended == ("holes of 28.1 cm^2 are filled",) and len(body.shape.parts(1.0)) == 1


def test_a_high_narrow_body_tips_early(tmp_path):
    pole = read_mesh(written(tmp_path, trimesh.creation.cylinder(0.01, 0.3)), "pole")
    assert pole.steady == pytest.approx(0.5, rel=0.01)
    cone = trimesh.creation.cone(0.05, 0.1).apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))
    assert read_mesh(written(tmp_path, cone), "top").steady < 0.15


def test_an_open_mesh_has_an_outline_and_no_mass(tmp_path):
    lid = BOX.copy()
    lid.update_faces(np.abs(lid.face_normals[:, 2] + 1.0) > 0.1)  # without a bottom
    found = read_mesh(written(tmp_path, lid), "lid", density=500.0)
    assert found.body.mass is found.body.mass_centre is None and found.body.fair == "yes"
    assert found.body.mended == (
        "the mesh is not closed: its mass and its centre of mass are unknown",
    )
    side = BOX.copy()
    side.update_faces(np.abs(side.face_normals[:, 0] + 1.0) > 0.1)
    assert read_mesh(written(tmp_path, side), "side").body.fair == ""


def test_a_noisy_scan_of_many_triangles_has_few_corners(tmp_path):
    fine = BOX.subdivide_to_size(0.002, max_iter=30)
    fine.merge_vertices()
    fine.vertices += np.random.default_rng(0).normal(0.0, 1e-4, fine.vertices.shape)
    body = read_mesh(written(tmp_path, fine, "scan.ply"), "scan").body
    assert len(fine.faces) > 20_000 and len(body.shape.outline(1.0)) < 20
    assert Polygon(body.shape.outline(body.radius)).area == pytest.approx(0.006, rel=0.02)


BESIDE = trimesh.util.concatenate([BOX, BOX.copy().apply_translation((0.2, 0.0, 0.0))])
UPRIGHT = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0.1]], [[0, 1, 2]])


@pytest.mark.parametrize(
    ("mesh", "text"),
    [
        (BOX.copy().apply_scale(1e3), r"is 100 m large; allowed: .* in cm or mm, --unit mm"),
        (BOX.copy().apply_scale(1e-3), "is 0.0001 m large; allowed: 0.002 to 1 m"),
        (BESIDE, r"has 2 parts that lie apart, seen from above, of 60\.0, 60\.0 cm\^2; a body"),
        (UPRIGHT, "covers nothing, seen from above; --up names"),
        (trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "is 0 mm high; allowed"),
    ],
)
def test_what_is_no_body_is_refused(tmp_path, mesh, text):
    with pytest.raises(DatasetError, match=text):
        read_mesh(written(tmp_path, mesh), "mine")


PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\n"
    b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 0\n1 0 0\n0 1 1\n3 0 1 7\n"
)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("part.step", b"ISO-10303", r"is no mesh that is read; allowed: \.stl, \.obj, \.ply"),
        ("part.stl", b"", "has 0 triangles; allowed: 1 to 5,000,000"),
        ("part.stl", b"solid a\nfacet normal", "damaged, or no STL file|0 triangles"),
        ("part.ply", b"<html>", "cannot be read: it is a web page|damaged, or no PLY file"),
        ("part.obj", b"v 0 0 0\nv 1 0 0\n", "has 0 triangles|damaged, or no OBJ file"),
        ("part.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 1\nf 1 2 3\n", "vertices that are NaN or Inf"),
        ("part.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 9\n", "damaged, or no OBJ file"),
        ("part.ply", PLY, "damaged: a triangle has a corner that is not in the file"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path, name, content, text):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DatasetError, match=text):
        read_mesh(tmp_path / name, "mine")
    with pytest.raises(DatasetError, match="cannot be read: No such file"):
        read_mesh(tmp_path / "gone.stl", "mine")
