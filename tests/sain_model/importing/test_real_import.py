# ruff: noqa: E501 - a case is a line
"""Recordings of a real robot become data sets: those of others, and a user's own."""

import json
import os
import zlib
from io import BytesIO, StringIO
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from rich.console import Console
from scipy.io import loadmat, savemat

from sain_core.errors import DatasetError, OutputError
from sain_core.push import STROKE_SIZE
from sain_core.scene import POSE, wrap_angle
from sain_core.shapes import library
from sain_core.shapes.outlines import OUTLINES_FILE
from sain_core.storage import read_arrays
from sain_core.transitions import IMPORTED, ORIGINS, SHAPED, Column
from sain_model.cli.real_import import RealImportOptions, run
from sain_model.data.dataset import Dataset, load_dataset, split_by_episode
from sain_model.importing.files import read_recordings
from sain_model.importing.real_pushes import MAT_HEADER
from tests.sain_model.importing.recorded import (
    HEADER,
    KNEE,
    PUSHES,
    Recorded,
    simulate,
    write_csv,
    write_mats,
    write_npz,
    write_stated,
)
from tests.sain_model.importing.recorded import turned as turned_by


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    return simulate(tmp_path_factory.mktemp("simulated"))


def convert(out: Path, *paths: Path, **options: object) -> tuple[Dataset, str]:
    """Return the data set of files, and what the command printed."""
    printed = StringIO()
    given = RealImportOptions(paths=paths, out=out, **options)  # type: ignore[arg-type]
    run(given, Console(file=printed, width=60))
    return load_dataset(out), printed.getvalue()


def poses(data: Dataset, column: str) -> np.ndarray:
    """Return poses of all rows in order of their body and place."""
    found = np.concatenate([getattr(part, column)[:, 0, POSE] for part in data.parts])
    return found[np.lexsort(np.concatenate([part.state[:, 0] for part in data.parts]).T)]


def test_all_forms_become_the_same_rows(rows, tmp_path):
    shapes = write_stated(tmp_path)
    sources = {
        "npz": write_npz(tmp_path / "all.npz", rows),
        "mat": write_mats(tmp_path / "logs", rows, ("poly4", "quadratic")),
        "csv": write_csv(tmp_path / "mine.csv", rows),
    }
    made = {}
    for name, path in sources.items():
        made[name], printed = convert(tmp_path / name, path, shapes=shapes)
        assert f"{2 * PUSHES} pushes of 2 bodies; surfaces: steel 8, wood 16" in printed
        assert ("24 rows state a push of another row once more" in printed) == (name == "mat")
        stored = read_arrays(tmp_path / name / "shard-00000.npz")
        assert list(stored) == list(IMPORTED)
        for column in IMPORTED:
            assert stored[column].shape == (24, *column.row_shape(1, STROKE_SIZE)), column
        for column in ("state", "next_state"):
            np.testing.assert_allclose(
                poses(made[name], column), poses(made["npz"], column), atol=1e-9
            )
    data = made["csv"]
    assert [part.bodies.shapes[0].name.split("-")[0] for part in data.parts] == ["knee", "oval"]
    assert [set(part.object.tolist()) for part in data.parts] == [{"knee"}, {"oval"}]
    assert set(data.parts[0].run.tolist()) == {"mine"}
    assert data.parts[0].surface.tolist().count("steel") == 4


def test_physics_predicts_what_it_has_simulated_and_no_split_divides_repeats(rows, tmp_path):
    """Frames, centroids and the tool's way are right: the prediction is what was recorded."""
    write_stated(tmp_path)
    data, printed = convert(tmp_path / "out", write_npz(tmp_path / "all.npz", rows))
    off = poses(data, "physics_next") - poses(data, "next_state")
    off[:, 2] = wrap_angle(off[:, 2])
    np.testing.assert_allclose(off, 0.0, atol=1e-6)
    moved = poses(data, "next_state") - poses(data, "state")
    assert np.abs(moved[:, :2]).max() > 0.02
    assert "nominal physics errs by 0.00 mm" in printed
    assert "16 groups of repeats, 67 % of pushes have one, at most 2 in a group" in printed
    split = split_by_episode(data, 0, 0.2, 0.2)
    parts = [set(part.episode.tolist()) for part in (split.train, split.validation, split.test)]
    assert not parts[0] & parts[1] and not parts[0] & parts[2]
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert card["transitions"] == 24 and card["groups_of_repeats"] == 16
    assert card["counts"]["surface"] == {"steel": 8, "wood": 16}


def test_a_data_set_has_its_outlines_with_it(rows, tmp_path, monkeypatch):
    write_stated(tmp_path)
    data, _ = convert(tmp_path / "out", write_npz(tmp_path / "all.npz", rows))
    assert all(part.bodies.lie_flat for part in data.parts)
    names = {part.bodies.on("feet").shapes[0].name for part in data.parts}
    others = {name: shape for name, shape in library._shapes.items() if name not in names}
    monkeypatch.setattr(library, "_shapes", others)
    monkeypatch.setattr(library, "_flat", {})
    again = load_dataset(tmp_path / "out")
    assert [part.bodies for part in again.parts] == [part.bodies for part in data.parts]
    assert names <= set(others)
    path = tmp_path / "out" / OUTLINES_FILE
    content = json.loads(path.read_text())
    next(iter(content["shapes"].values()))[0][0] += 1e-3
    path.write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=r"outlines.json is damaged: the outline of 'knee-"):
        load_dataset(tmp_path / "out")


def test_shapes_of_the_library_need_a_radius(rows, tmp_path):
    chosen = slice(PUSHES, None)
    columns = {name: value[chosen] for name, value in vars(rows).items()}
    named = Recorded(**columns | {"object": np.full(PUSHES, "ellipse")})
    path = write_csv(tmp_path / "mine.csv", named)
    with pytest.raises(
        DatasetError, match=r"mine.csv row 2: no file \(--shapes\) states an outlin"
    ):
        convert(tmp_path / "out", path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([f"{lines[0]},radius", *(f"{line},0.08" for line in lines[1:])]))
    data, _ = convert(tmp_path / "out", path)
    assert data.alike.bodies.shapes[0].name == "ellipse:flat"
    assert (data.alike.state[:, 0, 7] == 0.08).all()


def scaled(rows: Recorded, name: str, factor: float) -> Recorded:
    values = getattr(rows, name).copy()
    if name in ("before", "after") and factor == 180 / np.pi:
        values[:, 2] *= factor
    else:
        values *= factor
    return rows.changed(**{name: values})


@pytest.mark.parametrize(
    ("name", "factor", "message"),
    [
        ("before", 1e3, r"row 1: before is \[.*\]; it looks like millimetres; give metres, up to 10"),
        ("tip_end", 1e3, r"row 1: tip_end is \[.*\]; it looks like millimetres"),
        ("after", 180 / np.pi, r"row \d+: heading after is -?\d+.*; it looks like degrees; give ra"),
        ("speed", 1e3, r"row 1: speed is 20\.; allowed: 0.001 to 2 m/s; it looks like mm/s"),
        ("speed", 0.0, r"row 1: speed is 0\.; allowed: 0.001 to 2 m/s"),
        ("after", np.nan, r"row 1: after is \[nan nan nan\]; it must be finite"),
    ],
)  # fmt: skip
def test_numbers_that_cannot_be_are_refused(rows, tmp_path, name, factor, message):
    write_stated(tmp_path)
    npz = write_npz(tmp_path / "all.npz", scaled(rows, name, factor))
    with pytest.raises(DatasetError, match=message):
        convert(tmp_path / "out", npz)
    assert not (tmp_path / "out").exists()


def as_degrees(text: str, mark: str = "") -> str:
    """Return the text of a CSV file with headings in degrees."""
    lines = [line.split(",") for line in text.splitlines()]
    for place in (4, 7):
        lines[0][place] += mark
        for line in lines[1:]:
            line[place] = repr(float(line[place]) * 180 / np.pi)
    return "\n".join(map(",".join, lines))


def with_column(text: str, name: str, value: str) -> str:
    """Return the text with one more column, of the same value in each row."""
    first, *lines = text.splitlines()
    return "\n".join([f"{first},{name}", *(f"{line},{value}" for line in lines)])


def moved(text: str, column: int) -> str:
    """Return the text with a column at the end."""
    lines = [line.split(",") for line in text.splitlines()]
    return "\n".join(",".join([*one[:column], *one[column + 1 :], one[column]]) for one in lines)


ALSO_READ = {  # what it is changed to, and what is printed about it
    "quoted": (lambda text: text.replace(HEADER, ",".join(f'"{n}"' for n in HEADER.split(","))), ""),
    "windows": (lambda text: "\ufeff" + text.replace("\n", "\r\n") + "\r\n,,,,,,,,,,,,,\r\n", ""),
    "order": (lambda text: moved(text, 1), ""),
    "semicolons": (lambda text: text.replace(",", ";").replace(".", ","), "decimal commas are read as"),
    "tabs": (lambda text: text.replace(",", "\t"), ""),
    "index": (lambda text: "\n".join(f"{n or ''},{line}" for n, line in enumerate(text.splitlines())), "mine.csv: column 1, which has no name, not used"),
    "extra": (lambda text: "\n".join(f"{line},note" for line in text.splitlines()), "mine.csv: column 'note' not used"),
    "degrees": (lambda text: as_degrees(text, "_deg"), ""),
    "millimetres": (lambda text: text.replace("speed", "speed [mm/s]").replace(",0.02,", ",20,"), ""),
    "twice": (lambda text: text + text.splitlines()[1], "1 rows state a push of another row once"),
}  # fmt: skip


@pytest.mark.parametrize("name", ALSO_READ)
def test_tables_as_people_have_them_are_read(rows, tmp_path, name):
    change, note = ALSO_READ[name]
    path = write_csv(tmp_path / "mine.csv", rows)
    plain = read_recordings((path,), write_stated(tmp_path))
    path.write_text(change(path.read_text()))
    found = read_recordings((path,), tmp_path / "shapes.json")
    for column in ("before", "after", "tip_start", "tip_end", "speed"):
        wanted = getattr(plain.pushes, column)
        np.testing.assert_allclose(getattr(found.pushes, column), wanted, atol=1e-12)
    assert note in "\n".join(found.notes) and bool(note) == bool(found.notes)


def zipped(name: str) -> bytes:
    packed = BytesIO()
    with ZipFile(packed, "w") as archive:
        archive.writestr(name, "<xml/>")
    return packed.getvalue()


ALLOWED = "allowed: a header, then a row for each push, with columns separated by commas, semi"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("theta1", "phi"), "header of .* lacks theta1; it needs object"),
        (lambda text: text[:-40], r"row 25 has \d+ fields; the header 14"),
        (lambda text: text.replace("0.02,", "slow,", 1), r"row 2: speed is 'slow'; give a finite number"),
        (lambda text: text.replace("knee", "", 1), "row 2: object is empty"),
        (lambda text: HEADER, "has a header and no pushes"),
        (lambda text: text.replace("knee", '"cor', 1), r"line 25 is not read: unexpected end of data"),
        (lambda text: text.replace(",tip_radius", "").replace(",0.00475", ""), "give --tip-radius"),
        (lambda text: text.replace("tip_radius", "tip_raduis"), "has tip_raduis; rename it to tip_r"),
        (lambda text: text.replace("theta1", "theta_1"), "has theta_1; rename it to theta1: it ne"),
        (lambda text: text.replace("tip_x0", "x0"), "has x0 twice; it needs object"),
        (lambda text: text.replace("speed", "speed_deg"), "has speed in 'deg'; allowed: m/s, cm/s"),
        (lambda text: text.replace(",0.02,", ",,", 1), "row 2: speed is ''; give a finite number"),
        (lambda text: text.replace(",0.02,", ",nan,", 1), "row 2: speed is 'nan'; give a finite n"),
        (lambda text: text.replace("0.02,", "0,02,"), r"row 2 has 15 fields; .* by semicolons"),
        (
            lambda text: text.replace(",", ";").replace("0.02", "0,02"),
            r"row 2: \w+ is '.*', and numbers of this file have commas; write decimal points",
        ),
        (as_degrees, r"heading \w+ is -?\d+.*looks like degrees; .*, or of a CSV file .*--degrees"),
        (lambda text: with_column(text, "mass", "500"), r"mass is 500.* to 100 kg; 500 g are 0.5"),
        (lambda text: with_column(text, "radius", "80"), r"radius is 80.* to 0.5 m; 80 mm are 0"),
        (lambda text: b"", r"is empty \(0 bytes\)"),
        (lambda text: zipped("xl/workbook.xml"), r"is a spreadsheet \(.xlsx or .ods\); save its tab"),
        (lambda text: zipped("a.txt"), "is a zip archive; `unzip FILE` unpacks it"),
        (lambda text: text.encode("utf-16"), "is not UTF-8, but UTF-16 or no text; save it as UTF-8"),
        (lambda text: text.encode("utf-16-le"), "is not UTF-8, but UTF-16 or no text; save it as UTF-8"),
        (
            lambda text: f"# of May\n\n{text}".encode(),
            f"begins with '# of May'; its header is line 3: remove what is before it; {ALLOWED}",
        ),
        (lambda text: f"sep=;\n{text}".encode(), "begins with 'sep=;'; its header is line 2: remo"),
        (lambda text: text.replace(",", "|").encode(), rf"has columns separated by '\|'; {ALLOWED}"),
        (lambda text: text.replace(",", "  ").encode(), f"has columns separated by spaces; {ALLOWED}"),
        (lambda text: text.partition("\n")[2].encode(), "the header of .* lacks object, x0, y0"),
    ],
)  # fmt: skip
def test_a_csv_that_is_none_or_may_be_misread_is_refused(rows, tmp_path, change, message):
    path = write_csv(tmp_path / "mine.csv", rows)
    changed = change(path.read_text())  # type: ignore[operator]
    path.write_bytes(changed if isinstance(changed, bytes) else changed.encode())
    with pytest.raises(DatasetError, match=message):
        read_recordings((path,), write_stated(tmp_path))


@pytest.mark.parametrize("mark", ["", "_deg"])
def test_radians_that_are_given_as_degrees_are_named(rows, tmp_path, mark):
    path = write_csv(tmp_path / "mine.csv", rows)
    path.write_text(path.read_text().replace("theta0", f"theta0{mark}", 1))
    path.write_text(path.read_text().replace("theta1", f"theta1{mark}", 1))
    found = read_recordings((path,), write_stated(tmp_path), degrees=not mark)
    (note,) = found.notes
    assert note.startswith(f"warning: {path}: headings are read as degrees, and all are within ")
    assert "if they are radians, give neither --degrees nor a unit in the header" in note


def test_headings_in_degrees_are_found_by_how_bodies_turn(rows, tmp_path):
    """Small ones, which could be radians."""
    write_stated(tmp_path)
    turned = wrap_angle(rows.after[:, 2] - rows.before[:, 2]) * 180 / np.pi
    some = np.abs(turned) < 6.0
    columns = {name: value[some] for name, value in vars(rows).items()}
    before = rows.before[some] * [1, 1, 0]
    after = np.column_stack([rows.after[some, :2], turned[some]])
    both = columns | {"before": before, "after": after}
    for name in ("tip_start", "tip_end"):  # turned with the body
        both[name] = before[:, :2] + turned_by(-rows.before[some, 2], columns[name] - before[:, :2])
    both["after"][:, :2] = before[:, :2] + turned_by(
        -rows.before[some, 2], after[:, :2] - before[:, :2]
    )
    path = write_csv(tmp_path / "mine.csv", Recorded(**both))
    with pytest.raises(
        DatasetError, match=r"headings look like degrees\. In row \d+ the body would"
    ):
        convert(tmp_path / "out", path)
    data, printed = convert(tmp_path / "out", path, degrees=True)
    assert len(data) == some.sum() and "nominal physics errs by 0.00 mm" in printed


def test_another_data_set_is_replaced_only_with_overwrite(rows, tmp_path):
    out, path = tmp_path / "out", tmp_path / "rows.csv"
    write_stated(tmp_path)
    write_csv(path, rows)
    first, _ = convert(out, path)
    again, _ = convert(out, path)
    assert len(again) == len(first)
    before = (out / "card.json").read_bytes()
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]))
    with pytest.raises(
        OutputError, match=r"holds another data set .*differs in sources.*--overwrite"
    ):
        convert(out, path)
    assert (out / "card.json").read_bytes() == before
    fewer, _ = convert(out, path, overwrite=True)
    assert len(fewer) == len(first) - 1


def test_all_files_of_a_folder_are_read_or_named(rows, tmp_path):
    write_stated(tmp_path).rename(tmp_path / "Outlines.YAML")  # JSON is YAML
    write_csv(tmp_path / "B.CSV", rows)
    (tmp_path / "c.csv.gz").write_bytes(b"packed")
    (tmp_path / "notes.txt").write_text("of mine")
    found = read_recordings((tmp_path,))
    assert len(found.pushes) == 2 * PUSHES and "knee" in {name for name, _ in found.bodies}
    assert found.notes == (
        f"2 of {tmp_path} are of another form, and left out: c.csv.gz, notes.txt",
    )
    with pytest.raises(DatasetError, match=r"c.csv.gz is no file of pushes; unpack it first; allo"):
        read_recordings((tmp_path / "c.csv.gz",))
    write_stated(tmp_path)
    with pytest.raises(DatasetError, match=r"Outlines.YAML and .*shapes.json both state outlines"):
        read_recordings((tmp_path,))


def test_pushes_that_cannot_be_are_left_out_by_name(rows, tmp_path):
    write_stated(tmp_path)
    after, start = rows.after.copy(), rows.tip_start.copy()
    ways = np.hypot(*(rows.after - rows.before)[:, :2].T)
    touched = np.flatnonzero(ways > 0.005)
    spun, far, inside = touched[np.argsort(ways[touched])][:3]
    missed = np.flatnonzero((rows.after == rows.before).all(axis=1))[0]
    after[far, 0] += 0.3
    after[spun, 2] += 3.0
    after[missed, 1] += 0.02
    start[inside] = rows.before[inside, :2]  # a corner of the outline, by its frame
    end = rows.tip_end + start - rows.tip_start
    bad = rows.changed(after=after, tip_start=start, tip_end=end)
    npz = write_npz(tmp_path / "all.npz", bad)
    data, printed = convert(tmp_path / "out", npz)
    assert len(data) == 2 * PUSHES - 4
    for what, row in (
        ("the body moves farther than the tool", far),
        ("the body turns farther than the tool can turn it", spun),
        ("the body moves, and the tool never touches it", missed),
        ("the tool begins inside the body", inside),
    ):
        assert f"1 left out: {what} ({npz} row {row + 1})" in printed
    with pytest.raises(DatasetError, match=r"row \d+: the (body moves|tool begins) .*\d mm"):
        convert(tmp_path / "other", npz, skip_bad=False)
    everywhere = rows.changed(tip_start=rows.before[:, :2], tip_end=rows.before[:, :2] + 0.02)
    npz = write_npz(tmp_path / "all.npz", everywhere)
    with pytest.raises(DatasetError, match=r"24 of 24 pushes cannot be: .*begins .*mirrored"):
        convert(tmp_path / "other", npz)


def test_bodies_that_move_against_the_tool_are_a_warning(rows, tmp_path):
    write_stated(tmp_path)
    after = rows.after.copy()
    after[:, :2] = 1.5 * rows.before[:, :2] - 0.5 * after[:, :2]
    _, printed = convert(tmp_path / "out", write_npz(tmp_path / "all.npz", rows))
    assert "errs by more" not in printed
    npz = write_npz(tmp_path / "back.npz", rows.changed(after=after))
    _, printed = convert(tmp_path / "back", npz)
    assert "warning: nominal physics errs by more than the bodies move; do frames and" in printed


@pytest.mark.parametrize("place", [3.0, 0.03])
def test_outlines_elsewhere_than_the_pushes_are_refused(rows, tmp_path, place):
    write_stated(tmp_path)
    knees = {name: value[:PUSHES] for name, value in vars(rows).items()}
    write_stated(tmp_path, {"shapes": {"knee": (np.array(KNEE) + place).tolist()}})
    npz = write_npz(tmp_path / "all.npz", Recorded(**knees))
    with pytest.raises(DatasetError, match=r"\d+ of 12 pushes the tool never touches .* mirrored"):
        convert(tmp_path / "out", npz)
    assert not (tmp_path / "out").exists()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def of_another_form(path: Path) -> None:
    np.savez(path, wrench=np.zeros(3))


def crash(path: Path) -> None:
    """Damage a log so that SciPy 1.17 reads where no memory is: a type that does not exist."""
    savemat(path, loadmat(path, variable_names=["record_all", "vel"]), do_compression=False)
    content = bytearray(path.read_bytes())
    place = content.index(bytes.fromhex("0900000018000000"))  # the tag of three doubles
    content[place + 1] = 1
    path.write_bytes(content)


def bomb(path: Path) -> None:
    """Make a log unpack to half a gigabyte."""
    packed = zlib.compress(bytes(1 << 29), 1)
    header = path.read_bytes()[:MAT_HEADER]
    path.write_bytes(header + np.array([15, len(packed)], "<u4").tobytes() + packed)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("all.npz", cut, "all.npz is not a whole .npz file"),
        ("all.npz", of_another_form, "is of another form: it lacks surface, shape, speed"),
        ("log.mat", cut, "log.mat is not a whole MATLAB file"),
        ("log.mat", crash, "log.mat is not a whole MATLAB file"),
        ("log.mat", bomb, "log.mat is not read: it has more than .* bytes in its arrays"),
        ("all.npz", lambda path: path.unlink(), r"all.npz does not exist; the public pushes of Yu"),
        ("all.npz", lambda path: path.rename(path.with_suffix(".txt")) and path.mkdir(), "holds no"),
    ],
)  # fmt: skip
def test_a_file_that_is_none_is_refused(rows, tmp_path, name, change, message):
    shapes = write_stated(tmp_path)
    path = tmp_path / name
    if name.endswith(".npz"):
        write_npz(path, rows)
    else:
        next(write_mats(tmp_path / "logs", rows).iterdir()).rename(path)
    change(path)  # type: ignore[operator]
    with pytest.raises(DatasetError, match=message):
        read_recordings((path,), shapes)


@pytest.mark.skipif("SAIN_REAL_DATA" not in os.environ, reason="SAIN_REAL_DATA names no data")
def test_the_public_pushes_are_read(tmp_path):
    data, printed = convert(tmp_path / "out", Path(os.environ["SAIN_REAL_DATA"]))
    assert "11,323 pushes of 11 bodies; surfaces: abs 7,242, plywood 4,081" in printed
    assert "51 left out: the tool begins inside the body" in printed
    assert "10 left out: the body moves, and the tool never touches it" in printed
    assert "1 left out: the body turns farther than" in printed
    assert "279 never touch the body" in printed
    assert len(data) == 11_261 and len(np.unique(data.episode)) == 6_019
    assert all(part.action.shape == (len(part), 8) for part in data.parts)
    assert {*ORIGINS, *SHAPED} <= set(Column)
