"""From one look at an object without a tag to a shape that is found by its name."""

import io
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
import yaml
from rich.console import Console
from shapely import Polygon, affinity

from sain_core.errors import ConfigError, InvalidInputError, SainError
from sain_core.randomness import generator
from sain_core.scene import RADIUS
from sain_core.shapes.body_file import parse_bodies
from sain_core.shapes.library import get_shape, own_bodies
from sain_core.shapes.outlines import trace
from sain_vision.detection.outlines import OutlineConfig, OutlineFinder
from sain_vision.detection.tracing import trace_top
from sain_vision.optics import check_calibration
from sain_vision.ros import new_shape
from sain_vision.ros.new_shape import NewShapeOptions, describe, run
from tests.sain_vision.detection.test_outlines import AWAY, CAMERA, CONFIG, START, camera_of

T = 1  # the body that is looked at


@pytest.fixture(scope="module")
def depth():
    config, random = replace(CONFIG, depth_noise=0.0003), generator(0, "look")
    return camera_of(config).take(AWAY, START, random).depth


@pytest.fixture
def look(tmp_path, depth, monkeypatch):
    """Options of the command, whose camera sees the bodies."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    grey = np.zeros((*depth.shape, 3), np.uint8)
    metres = np.where(depth > 0, depth * 1e-3, np.nan)
    monkeypatch.setattr(new_shape, "_look", lambda options: (metres, CAMERA, grey))
    return {"name": "mine", "near": tuple(START[T, :2].tolist()), "yes": True}


def test_one_look_makes_a_shape_that_is_found_by_its_name(look, tmp_path, depth, capsys):
    run(NewShapeOptions(**look), Console(width=200))
    said = capsys.readouterr().out
    row = yaml.safe_load(said[said.index("{name") :])
    bodies = parse_bodies({"bodies": [row]})
    assert bodies.radii[0] == pytest.approx(START[T, RADIUS], abs=0.003)
    shape = get_shape("mine:flat")
    mine, true = (
        Polygon(one.outline(radius))
        for one, radius in ((shape, bodies.radii[0]), (get_shape("t"), START[T, RADIUS]))
    )
    placed = affinity.rotate(true, START[T, 2], origin=(0, 0), use_radians=True)
    assert mine.intersection(placed).area / mine.union(placed).area > 0.94
    picture = cv2.imread(str(next(tmp_path.rglob("mine.png"))))
    assert picture.shape == (2 * CONFIG.height, 2 * CONFIG.width, 3)
    with pytest.raises(ConfigError, match="there is a shape 'mine'; take another name; or"):
        NewShapeOptions(**look)
    run(NewShapeOptions(**look, overwrite=True), Console(width=200))
    metres = np.where(depth > 0, depth * 1e-3, np.nan)
    (found,), _ = OutlineFinder(bodies, OutlineConfig()).find(metres, CAMERA, {})
    np.testing.assert_allclose(found.pose[:2], START[T, :2], atol=0.0025)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"name": "a/b"}, "name is 'a/b'; allowed: letters"),
        ({"name": ".."}, "name is '..'; allowed: letters, .* no '-' or '.' first"),
        ({"name": "disk", "overwrite": True}, "there is a shape 'disk'"),
        ({"yes": False}, "there is no terminal to confirm"),
        ({"name": "a.yaml"}, "name is 'a.yaml'; allowed: .* no .yaml or .json last"),
        ({"out": Path("mine.png")}, "out is mine.png; its name must end in .yaml"),
        ({"near": (5.0, 5.0)}, r"nearest to \(5, 5\) m is [67].\d\d m away; correct --near"),
    ],
)
def test_what_cannot_be_used_is_said(look, monkeypatch, change, text):
    monkeypatch.setattr("sys.stdin", io.StringIO())  # there is no terminal
    with pytest.raises((ConfigError, SainError), match=text):
        run(NewShapeOptions(**(look | change)), Console())


def test_a_mesh_makes_a_shape_with_height_mass_and_centre(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    mesh = trimesh.creation.box((100.0, 60.0, 90.0))
    mesh.export(tmp_path / "box.stl")
    options = {"name": "carton", "mesh": tmp_path / "box.stl"}
    with pytest.raises(SainError, match=r"box\.stl is 100 m large; .* --unit mm"):
        run(NewShapeOptions(**options), Console(width=200))
    run(NewShapeOptions(**options, unit="mm", density=300.0), Console(width=200))
    said = capsys.readouterr().out
    assert "100 x 60 mm, 90 mm high" in said and "a fair flat body: yes" in said
    assert "where the friction is above 1.50; it is higher than wide, so a fast push" in said
    row = yaml.safe_load(said[said.index("{name") :])
    bodies = parse_bodies({"bodies": [row]})
    assert (bodies.heights, bodies.masses) == ((0.09,), (0.162,))
    own = own_bodies()["carton"]
    assert (own.height, own.mass, own.mass_centre, own.fair) == (0.09, 0.162, (0.0, 0.0), "yes")
    with pytest.raises(ConfigError, match=r"density is 0\.2 kg/m"):
        NewShapeOptions(**options, density=0.2, overwrite=True)


DOWN = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])
ABOVE = check_calibration(
    640, 480, np.array([[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]), "plumb_bob", np.zeros(5)
).moved(DOWN, np.array([0.5, 0.0, 0.9]))


def table_with(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """Return depths [m] of boxes (x, y, width, height) [px] of 40 mm, seen from above."""
    depths = np.full((480, 640), 0.9)
    for x, y, width, height in boxes:
        depths[y : y + height, x : x + width] = 0.86
    return depths


@pytest.mark.parametrize(
    ("depths", "text"),
    [
        (table_with(), "no object stands on the table in the image: lay it into the middle"),
        (table_with((0, 200, 60, 40)), "image; 1 that the image's edge cuts do not count"),
        (table_with((280, 200, 200, 1)), "the object has no flat top that is wider than a pixel"),
        (
            table_with() + np.random.default_rng(0).integers(-60, 60, (480, 640)) * 1e-3,
            "is its depth noisy, or is it an edge of the table",
        ),
    ],
)
def test_what_has_no_top_is_refused(depths, text):
    with pytest.raises(InvalidInputError, match=text):
        trace_top(depths, ABOVE, None)


def test_one_of_two_objects_is_named_as_such():
    top = trace_top(table_with((280, 200, 60, 40), (400, 200, 60, 41)), ABOVE, None)
    text = describe(top, trace("mine", top.outline))
    assert text.startswith("one of 2 objects, chosen by --near or as the largest; 103 x 70 mm")
