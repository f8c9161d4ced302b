# ruff: noqa: E501 - a case is a line
"""Logs of pushes with one finger, two fingers and bars become one data set that is learned from."""

import csv
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from sain_core.errors import DatasetError
from sain_core.push import SPAN, STROKE_SIZE, make_stroke
from sain_core.scene import MASS, POSITION, RADIUS, THETA, unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import read_stated
from sain_model import commands
from sain_model.cli.real_import import RealImportOptions, run
from sain_model.data.dataset import Dataset, load_dataset
from sain_model.importing.csv_files import read_csv
from sain_model.importing.files import read_recordings
from sain_model.inference.kinds import surface_kind
from sain_model.physics.planar import PlanarPrior, first_touch
from tests.sain_model.importing.recorded import write_stated

Row = dict[str, object]
TIP = 0.005
BOX = {"shapes": {"box": [[0.0, 0.0], [0.1, 0.0], [0.1, 0.06], [0.0, 0.06]]}}
MIDDLE = np.array([0.05, 0.03])  # [m], of the box
KINDS = ("one", "tip2", "distance", "bar")  # how rows state the tool, in turns
COUNT = 32


def turned(angle: float, vector: np.ndarray) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])


@pytest.fixture(scope="module")
def rows(tmp_path_factory) -> list[Row]:
    """Return pushes of a box by the project's own physics, as a user writes them down."""
    box = read_stated(write_stated(tmp_path_factory.mktemp("box"), BOX)).bodies["box"]
    bodies, random = Bodies((box.shape.on("flat"),)), np.random.default_rng(4)
    prior, made = PlanarPrior(surface_kind().config, bodies), list[Row]()
    while len(made) < COUNT:
        kind, theta, bearing = KINDS[len(made) % 4], *random.uniform(-3.0, 3.0, 2)
        middle = np.array([0.4, 0.0]) + random.uniform(-0.1, 0.1, 2)
        heading = bearing + np.pi + random.uniform(-0.4, 0.4)
        across = heading + np.pi / 2 + random.uniform(-0.3, 0.3)
        span = (kind != "one") * random.uniform(0.02, 0.06) * unit(across)
        start = middle + 0.08 * unit(bearing) - 0.5 * span
        state = np.zeros((1, 1, 8))
        state[0, 0, POSITION], state[0, 0, THETA], state[0, 0, MASS] = middle, theta, 1.0
        state[0, 0, RADIUS] = box.radius
        stroke = make_stroke(
            start[None],
            heading,
            0.07,
            speed=0.02,
            tip_radius=TIP,
            span=span[None],
            bar=kind == "bar",
        )
        touch = first_touch(state, stroke, bodies)
        if touch.inside[0] or np.isinf(touch.distance[0]):
            continue
        after = prior.step(state, stroke)[0, 0]
        tip = start + 0.5 * span * (kind == "bar")
        ends = (*tip, *(tip + 0.07 * unit(heading)))
        poses = [
            (*(place - turned(angle, MIDDLE)), angle)
            for place, angle in ((middle, theta), (after[POSITION], after[THETA]))
        ]
        row: Row = {"object": "box", "speed": 0.02, "tip_radius": TIP, "surface": "steel"}
        row |= dict(zip(("x0", "y0", "theta0", "x1", "y1", "theta1"), np.ravel(poses), strict=True))
        row |= dict(zip(("tip_x0", "tip_y0", "tip_x1", "tip_y1"), ends, strict=True))
        if kind == "tip2":
            row |= {"tip2_x0": start[0] + span[0], "tip2_y0": start[1] + span[1]}
        elif kind != "one":
            first, second = (
                ("bar_width", "bar_angle") if kind == "bar" else ("finger_distance", "finger_angle")
            )
            width = np.linalg.norm(span) + 2 * TIP * (kind == "bar")
            row |= {first: width, second: np.arctan2(span[1], span[0])}
        made.append(row)
    return made


def write(folder: Path, rows: list[Row]) -> Path:
    """Write rows and outlines; a row leaves empty what it does not state."""
    write_stated(folder, BOX)
    path, names = folder / "mine.csv", list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, names, restval="")
        table.writeheader()
        table.writerows(rows)
    return path


def convert(folder: Path, rows: list[Row], **options: object) -> tuple[Dataset, str]:
    printed = StringIO()
    paths, out = (write(folder, rows),), folder / "out"
    given = RealImportOptions(paths=paths, out=out, overwrite=True, **options)  # type: ignore[arg-type]
    run(given, Console(file=printed, width=60))
    return load_dataset(out), printed.getvalue()


def changed(rows: list[Row], index: int, **values: object) -> list[Row]:
    return [row | values if place == index else row for place, row in enumerate(rows)]


def test_tools_of_every_kind_are_read_as_what_they_did(rows, tmp_path):
    """Physics predicts what it has simulated: columns, units and frames are right."""
    data, printed = convert(tmp_path, rows)
    assert "16 are with two fingers, 8 with a bar" in printed
    assert "nominal physics errs by 0.00 mm" in printed
    action = data.alike.action
    assert action.shape == (COUNT, STROKE_SIZE)
    np.testing.assert_array_equal(action[:, SPAN].any(axis=1), np.arange(COUNT) % 4 > 0)
    np.testing.assert_array_equal(action[:, -1], np.arange(COUNT) % 4 == 3)
    in_degrees = [
        {
            k: np.degrees(v) if k.startswith("theta") or k.endswith("angle") else v
            for k, v in row.items()
        }
        for row in rows
    ]
    again, _ = convert(tmp_path, in_degrees, degrees=True)
    np.testing.assert_allclose(again.alike.action, action, atol=1e-12)


def test_a_second_finger_s_end_shows_whether_the_tool_turned(rows, tmp_path):
    one = rows[1]
    way = [float(one[f"tip_{axis}1"]) - float(one[f"tip_{axis}0"]) for axis in "xy"]  # type: ignore[arg-type]
    end = {
        f"tip2_{axis}1": float(one[f"tip2_{axis}0"]) + w for axis, w in zip("xy", way, strict=True)
    }  # type: ignore[arg-type]
    data, _ = convert(tmp_path, changed(rows, 1, **end))
    assert len(data) == COUNT
    end["tip2_y1"] += 0.01
    with pytest.raises(DatasetError, match=r"row 3: .*differs by 10.0 mm .*; allowed: up to 2 mm"):
        convert(tmp_path, changed(rows, 1, **end), skip_bad=False)
    data, printed = convert(tmp_path, changed(rows, 1, **end))
    assert len(data) == COUNT - 1 and "1 left out: the tool turns (" in printed


def test_pushes_with_another_second_finger_are_no_repeats(rows, tmp_path):
    other = rows[1] | {"tip2_x0": "", "tip2_y0": "", "x1": float(rows[1]["x1"]) + 1e-6}  # type: ignore[arg-type]
    nearer = rows[2] | {"finger_distance": float(rows[2]["finger_distance"]) - 0.005}  # type: ignore[arg-type]
    again = rows[3] | {"y1": float(rows[3]["y1"]) + 1e-6}  # type: ignore[arg-type]
    data, printed = convert(tmp_path, [*rows, other, nearer, again])
    assert len(data) == COUNT + 3
    assert f"{COUNT + 2} groups of repeats" in printed


def test_angles_that_could_be_radians_are_named(rows, tmp_path):
    path = write(tmp_path, rows)
    _, notes = read_csv(path, degrees=True)
    kinds = ("headings", "finger angles", "bar angles")
    for kind, note in zip(kinds, notes, strict=True):
        assert f"{kind} are read as degrees, and all are within" in note
    assert not read_csv(path)[1]


def test_identify_and_train_run_on_them(rows, tmp_path, monkeypatch, capsys):
    convert(tmp_path, rows)
    monkeypatch.chdir(tmp_path)
    short = ("--epochs", "1", "--epoch-steps", "2", "--test", "0.3")
    for command, *words in (
        ("identify", "out", "--out", "belief.json"),
        ("train", "out", "--belief", "belief.json", "--out", "run", *short),
        ("evaluate", "out", "--checkpoint", "run/sain.safetensors"),
    ):
        assert getattr(commands, command)(words) == 0, capsys.readouterr()


@pytest.mark.parametrize(
    ("index", "values", "message"),
    [
        (0, {"tip2_x0": 0.4}, "row 2 has tip2_x0 and no tip2_y0; give both, or neither"),
        (3, {"bar_angle": ""}, "row 5 has bar_width and no bar_angle; give both"),
        (1, {"bar_width": 0.05, "bar_angle": 0.0}, "row 3 has tip2_x0, tip2_y0 and bar_width, bar_angle; a tool has"),
        (0, {"tip2_x1": 0.4, "tip2_y1": 0.0}, "row 2 has tip2_x1, tip2_y1; a tool has one finger"),
        (2, {"finger_distance": 42.0}, r"row 4: second finger is .*looks like millimetres"),
        (2, {"finger_distance": -0.04}, "row 4: finger_distance is -0.04; it must be positive"),
        (2, {"finger_distance": 0}, "row 4: finger_distance is 0; .*leave it empty for one finger"),
        (2, {"finger_distance": 4.2}, r"row 4: distance of the fingers' axes is 4.2; allowed: 2 tip_radius to 0.5 m; it looks like mm"),
        (2, {"finger_distance": 0.004}, r"distance of the fingers' axes is 0.004; .*leave it empty for one finger"),
        (2, {"finger_angle": 90.0}, "row 4: finger_angle is 90; it looks like degrees; give radians"),
        (3, {"bar_width": 0.009}, "row 5: bar_width is 0.009; allowed: 2 tip_radius to 0.5 m"),
        (1, {"tip2_x0": 412.0, "tip2_y0": 33.0}, r"row 3: second finger is \[412. +33.\]; it looks like millim"),
        (1, {"tip2_x0": "left"}, "row 3: tip2_x0 is 'left'; give a finite number"),
    ],
)  # fmt: skip
def test_a_second_contact_that_cannot_be_is_refused(rows, tmp_path, index, values, message):
    with pytest.raises(DatasetError, match=message):
        read_recordings((write(tmp_path, changed(rows, index, **values)),))


def test_a_second_finger_inside_the_body_is_named(rows, tmp_path):
    inside = np.array([rows[1]["x0"], rows[1]["y0"]]) + turned(float(rows[1]["theta0"]), MIDDLE)  # type: ignore[arg-type]
    bad = changed(rows, 1, tip2_x0=inside[0], tip2_y0=inside[1])
    with pytest.raises(
        DatasetError,
        match=r"row 3: the second finger begins 35.0 mm inside the body; allowed: up to 1",
    ):
        convert(tmp_path, bad, skip_bad=False)
    data, printed = convert(tmp_path, bad)
    assert len(data) == COUNT - 1 and "1 left out: the tool begins inside the body (" in printed


def test_published_forms_may_state_a_second_finger(rows, tmp_path):
    some = [row for row in rows if KINDS[rows.index(row) % 4] in ("one", "tip2")]
    columns = {
        "init_pose": ("x0", "y0", "theta0"), "final_pose": ("x1", "y1", "theta1"),
        "tip_init": ("tip_x0", "tip_y0"), "tip_final": ("tip_x1", "tip_y1"),
        "tip2_init": ("tip2_x0", "tip2_y0"),
    }  # fmt: skip
    arrays = {
        k: np.array([[row.get(n, np.nan) for n in names] for row in some])
        for k, names in columns.items()
    }
    write_stated(tmp_path, BOX)
    np.savez(
        tmp_path / "all.npz", surface=np.full(len(some), "steel"), shape=np.full(len(some), "box"),
        speed=np.full(len(some), 0.02), **arrays,
    )  # fmt: skip
    found = read_recordings((tmp_path / "all.npz",), tip_radius=TIP)
    plain = read_recordings((write(tmp_path, some),))
    np.testing.assert_allclose(found.pushes.span, plain.pushes.span, atol=1e-12)
    assert found.pushes.span.any()
