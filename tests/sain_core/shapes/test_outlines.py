# ruff: noqa: E501 - a case is a line
"""Bodies by their outlines."""

import json

import numpy as np
import pytest

from sain_core.errors import ConfigError, DatasetError, InvalidInputError
from sain_core.scene import unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import (
    check_shapes,
    get_shape,
    outline_folder,
    register_outlines,
    shape_names,
)
from sain_core.shapes.outlines import FINEST, OUTLINES_FILE, trace, write_outlines
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
        (json.dumps({"shapes": {"comb": comb(20)}}), "convex parts; allowed: 64 and 12"),
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
