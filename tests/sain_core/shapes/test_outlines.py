# ruff: noqa: E501 - a case is a line
"""Bodies by their outlines."""

import json
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import ConfigError, DatasetError, InvalidInputError
from sain_core.scene import DISK_HEIGHT, unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import outlined_bodies
from sain_core.shapes.library import (
    check_shapes,
    get_shape,
    outline_folder,
    register_outlines,
    shape_names,
)
from sain_core.shapes.outlines import (
    FINEST,
    OUTLINES_FILE,
    named_outlines,
    read_outlines,
    trace,
    write_outlines,
)
from sain_core.shapes.solids import centroid


def smooth(count: int = 600) -> np.ndarray:
    """An outline with a waist, as a butterfly has."""
    bearing = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return (0.06 + 0.02 * np.cos(2 * bearing))[:, None] * unit(bearing) + (0.01, -0.02)


def test_a_traced_body_is_about_its_centroid():
    body = trace("butterfly", smooth())
    assert body.shape.name.startswith("butterfly-")
    np.testing.assert_allclose(body.centre, centroid(smooth()), atol=1e-4)
    outline = body.shape.outline(body.radius)
    assert len(outline) < 150
    away = np.abs(np.hypot(*(outline + body.centre - (0.01, -0.02)).T))
    bearing = np.arctan2(*(outline + body.centre - (0.01, -0.02)).T[::-1])
    assert np.abs(away - 0.06 - 0.02 * np.cos(2 * bearing)).max() < FINEST


def test_outlines_stand_beside_a_data_set(tmp_path):
    register_outlines(tmp_path)  # there are none
    body = trace("butterfly", smooth())
    write_outlines(tmp_path, [body.shape, get_shape("disk")])
    register_outlines(tmp_path)
    assert get_shape(body.shape.name) == body.shape
    path = tmp_path / OUTLINES_FILE
    good = json.loads(path.read_text())
    for wrong in ([], {"shapes": [1]}, {"shapes": {"a-123456": [[0, 1], [1, 0], [0, 0]]}}, {}):
        path.write_text(json.dumps(wrong))
        with pytest.raises(DatasetError, match=r"outlines\.json is damaged"):
            register_outlines(tmp_path)
    path.write_text(json.dumps(good)[:-9])
    with pytest.raises(DatasetError, match=r"outlines\.json is damaged"):
        register_outlines(tmp_path)


def comb(teeth: int) -> list[list[float]]:
    """Return the outline of a comb: it has about a convex part for each tooth."""
    top = [(0.01 * n, 0.05 if n % 2 else 0.02) for n in range(2 * teeth)]
    return [list(p) for p in [(0.0, 0.0), (0.01 * (2 * teeth - 1), 0.0), *top[::-1]]]


def test_an_outline_file_is_a_shape_by_its_path_and_by_its_name(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    file = outline_folder() / "comb.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps({"shapes": {"comb": comb(4)}}))
    shape = get_shape("comb")
    assert shape.is_traced and len(shape.parts(1.0)) > 1
    assert get_shape(str(file)) == get_shape(shape.name) == shape
    assert get_shape("comb:flat").lies_flat and "comb" in shape_names()
    assert Bodies.named(("comb:flat", "disk")).shapes[0].name == f"{shape.name}:flat"
    with pytest.raises(InvalidInputError, match="shape of body 0 is a path"):
        check_shapes([str(file)])
    with pytest.raises(ConfigError, match="shape is 'comb-000000'"):
        get_shape("comb-000000")


BODY = "{shapes: {a: {semi_axes: [0.1, 0.2]}}"


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("[", "cannot be read"),
        ("shapes: {}", "states no outlines"),
        (f"{BODY}, tip_radius: -1}}", "tip_radius is -1; allowed: 0.001 to 0.05 m"),
        (f"{BODY}, tip_radius: 5}}", "tip_radius is 5; .* 5 millimetres are 0.005 m"),
        (f"{BODY}, tip_radius: true}}", "tip_radius is True; allowed: 0.001 to 0.05 m"),
        ("shapes: {a: {semi_axes: [0.1, true]}}", r"semi_axes\[1\] is True; allowed: finite numbers"),
        ("shapes: {a: {semi_axes: 3}}", "semi_axes is 3; it must be a list of 2 numbers"),
        ("shapes: {a: [[0, 0], [0, 1], [true, 1]]}", r"point 3 of .*'a'\[0\] is True; allowed"),
        ("shapes: {a: [[0, 0], [0, '1'], [1, 1]]}", r"point 2 of .*\[1\] is '1'; allowed: finite"),
        ("shapes: {a: [[0, 0], [0, 1], [1]]}", r"point 3 of .* is \[1\]; it must be a list of 2"),
        ("shapes: {a: [1, 2]}", "is no outline: give 3 to 10000 points"),
        ("shapes: {a: {semi_axes: [1, 2]}, b: {semi_axes: [1, 2]}}", "'a' has a radius of"),
        ("shapes: {a: {semi_axes: [0.1, 0.2]}, b: {semi_axes: [0.1, 0.1]}}", "states 2 shapes"),
        (json.dumps({"shapes": {"comb": comb(30)}}), "convex parts even where 5 mm .*; allowed: 64 and 24"),
    ],
)  # fmt: skip
def test_an_outline_file_that_cannot_be_used_is_named(tmp_path, content, text):
    path = tmp_path / "mine.yaml"
    path.write_text(content)
    with pytest.raises(ConfigError, match=r"shape '.*mine\.yaml' is not read: .*" + text):
        get_shape(str(path))
    with pytest.raises(ConfigError, match=r"gone\.yaml.* is not read"):
        get_shape(str(tmp_path / "gone.yaml"))


SQUARE = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (SQUARE[[0, 2, 1, 3]], r"at \(0.05, 0.05\) m, where the sides from point 1 to 2 and from 3 to 4"),
        (SQUARE[[0, 1]][[0, 1, 0]] * [[1, 1]], "encloses nothing: its area is 0 mm"),
        (np.array([[0.0, 0.0], [0.05, 0.05], [0.1, 0.1]]), "encloses nothing: .* points in a line"),
        (SQUARE[[0, 0, 0, 1]], "encloses nothing: its area is 0 mm"),
        (1e3 * SQUARE, "radius of 70.71 m: it looks like millimetres; allowed"),
        (1e-3 * SQUARE, r"radius of 7.07\de-05 m; allowed"),
    ],
)  # fmt: skip
def test_an_outline_that_is_none_is_refused_with_its_points(points, message):
    with pytest.raises(DatasetError, match=message):
        trace("mine", points)


def test_an_outline_is_mended_with_a_word(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    outline_folder().mkdir(parents=True)
    stated = SQUARE[[0, 3, 3, 2, 1, 0]].tolist()
    (outline_folder() / "turned.yaml").write_text(json.dumps({"shapes": {"turned": stated}}))
    first, second = get_shape("turned").outline(1.0)[:2]
    assert first[0] * second[1] > first[1] * second[0]
    assert "'turned': point 3 repeats the one before: left out" in caplog.text
    assert "'turned': it runs clockwise: turned round" in caplog.text
    assert trace("turned", SQUARE).mended == ()


BAR = [[-0.1, -0.02], [0.1, -0.02], [0.1, 0.02], [-0.1, 0.02]]


def objects(folder: Path, *rows: object) -> Path:
    """Write a file in the format of Push Anything."""
    path = folder / "objects.json"
    path.write_text(json.dumps({"units": "m, kg", "objects": list(rows)}))
    return path


def a_bar(**more: object) -> dict[str, object]:
    return {"name": "Letter I (scan)", "outline_m": BAR, "height_m": 0.05, **more}


def test_a_file_of_objects_is_bodies_by_name(tmp_path):
    fine = [*BAR[:2], [0.11, 0.0], *BAR[2:]]
    path = objects(
        tmp_path,
        a_bar(mass_kg_sdf=0.05, com_uniform_density_minus_centroid_m=[0.004, 0.0], fair_2d="no"),
        a_bar(name="Push T", outline_fine_m=fine, height_m=None, holes_dropped_m2=[0.002]),
        a_bar(
            name="Expo-Box",
            outline_m=BAR[::-1],
            slice_area_over_projection={"25": 0.95, "50": 0.85},
        ),
    )
    outlines = read_outlines(path)
    assert list(outlines) == ["letter_i", "push_t", "expo_box"]
    letter, tee, box = outlines.values()
    assert (letter.height, letter.mass, letter.mass_centre) == (0.05, 0.05, (0.004, 0.0))
    assert (letter.fair, tee.fair, box.fair) == ("no", "", "roughly")
    assert tee.mended == ("holes of 20.0 cm^2 are filled",) and len(tee.shape.outline(1.0)) == 5
    assert box.mended == ("it runs clockwise: turned round",)
    bodies = outlined_bodies(outlines, ("push_t", "letter_i", "push_t"), tagged=True)
    assert bodies.names == ("push_t_0", "letter_i", "push_t_2") and bodies.bodies.lie_flat
    assert bodies.heights == (DISK_HEIGHT, 0.05, DISK_HEIGHT) and not bodies.weighed
    assert [tag.number for (tag,) in bodies.tags] == [0, 1, 2]
    assert get_shape(f"{path}:push_t:flat") == bodies.bodies.shapes[0]
    with pytest.raises(
        ConfigError, match=r"'letter_l' is unknown \(did you mean 'letter_i'\?\); known: "
    ):
        named_outlines(outlines, ["letter_l"])
    with pytest.raises(
        ConfigError, match=r"states 3 shapes; .* name one as '.*objects\.json:letter_i'"
    ):
        get_shape(str(path))


def test_too_many_corners_are_left_out_with_a_word(tmp_path):
    ring = 0.06 * unit(np.linspace(0.0, 2 * np.pi, 400, endpoint=False))
    (body,) = read_outlines(objects(tmp_path, a_bar(outline_m=ring.tolist()))).values()
    assert len(body.shape.outline(1.0)) <= 64 and body.radius == pytest.approx(0.06, abs=5e-4)
    assert body.mended == ("corners within 0.5 mm are left out",)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([], "states no outlines; .* or a list objects"),
        ([3], "objects must be a list, of objects with name and outline"),
        ([a_bar(name=None)], "name of object 1 is None; it must be a text"),
        ([a_bar(name="(?)")], r"a body is called '\(\?\)'; a name needs a letter"),
        ([a_bar(), a_bar(name="letter i")], r"two bodies are called letter_i: 'Letter I \(scan\)' and 'letter i'"),
        ([a_bar(outline_m=None)], "'letter_i' is no outline: give 3 to 10000 points"),
        ([a_bar(outline_m=[BAR[k] for k in (0, 2, 1, 3)])], "'letter_i' crosses itself at"),
        ([a_bar(outline_m=(1e3 * np.array(BAR)).tolist())], "radius of 102 m: it looks like millimetres"),
        ([a_bar(outline_m=[[float("nan"), 0.0], *BAR])], r"point 1 of .*\[0\] is nan; allowed: finite"),
        ([a_bar(height_m=50)], "height is 50; allowed: 0.001 to 0.5 m: 50 millimetres are 0.05 m"),
        ([a_bar(mass_kg_sdf=-1)], "mass is -1; allowed: 0.001 to 100 kg"),
        ([a_bar(fair_2d="perhaps")], "fair_2d is 'perhaps'; allowed: yes, roughly, no"),
        ([a_bar(slice_area_over_projection=[1])], r"slices is \[1\]; give shares by height"),
    ],
)  # fmt: skip
def test_a_damaged_file_of_objects_is_refused_with_what_is_wrong(tmp_path, rows, text):
    with pytest.raises(DatasetError, match=text):
        read_outlines(objects(tmp_path, *rows))


def test_a_key_that_is_not_read_is_named(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(json.dumps({"shapes": {"mine": {"outline": BAR, "hight": 0.1}}}))
    with pytest.raises(
        DatasetError, match=r"'mine' has 'hight' \(did you mean 'height'\?\); allowed"
    ):
        read_outlines(path)
    path.write_text(f"shapes: {{mine: {{outline: {BAR}, fair_2d: yes}}}}")
    assert read_outlines(path)["mine"].fair == "yes"
