"""Recordings of a real robot become data sets: those of others, and a user's own."""

import json
import os
import zlib
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from scipy.io import loadmat, savemat

from sain_core.errors import DatasetError
from sain_core.scene import POSE, wrap_angle
from sain_core.shapes import library
from sain_core.shapes.outlines import OUTLINES_FILE
from sain_core.storage import read_arrays
from sain_core.transitions import IMPORTED, ORIGINS, SHAPED, Column
from sain_model.cli.real_import import RealImportOptions, run
from sain_model.data.dataset import Dataset, load_dataset, split_by_episode
from sain_model.importing.files import read_recordings
from sain_model.importing.mat_logs import MAT_HEADER
from tests.sain_model.importing.recorded import (
    HEADER,
    PUSHES,
    Recorded,
    simulate,
    write_csv,
    write_mats,
    write_npz,
    write_stated,
)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
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


def test_all_forms_become_the_same_rows(rows: Recorded, tmp_path: Path) -> None:
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
            assert stored[column].shape == (24, *column.row_shape(1, 8)), column
        for column in ("state", "next_state"):
            np.testing.assert_allclose(
                poses(made[name], column), poses(made["npz"], column), atol=1e-9
            )
    data = made["csv"]
    assert [part.bodies.shapes[0].name.split("-")[0] for part in data.parts] == ["knee", "oval"]
    assert [set(part.object.tolist()) for part in data.parts] == [{"knee"}, {"oval"}]
    assert set(data.parts[0].run.tolist()) == {"mine"}
    assert data.parts[0].surface.tolist().count("steel") == 4


def test_physics_predicts_what_it_has_simulated(rows: Recorded, tmp_path: Path) -> None:
    """Frames, centroids and the tool's way are right: the prediction is what was recorded."""
    write_stated(tmp_path)
    data, printed = convert(tmp_path / "out", write_npz(tmp_path / "all.npz", rows))
    off = poses(data, "physics_next") - poses(data, "next_state")
    off[:, 2] = wrap_angle(off[:, 2])
    np.testing.assert_allclose(off, 0.0, atol=1e-6)
    moved = poses(data, "next_state") - poses(data, "state")
    assert np.abs(moved[:, :2]).max() > 0.02
    assert "nominal physics errs by 0.00 mm" in printed


def test_no_split_divides_repeats(rows: Recorded, tmp_path: Path) -> None:
    write_stated(tmp_path)
    data, printed = convert(tmp_path / "out", write_npz(tmp_path / "all.npz", rows))
    assert "16 groups of repeats, 67 % of pushes have one, at most 2 in a group" in printed
    split = split_by_episode(data, 0, 0.2, 0.2)
    parts = [set(part.episode.tolist()) for part in (split.train, split.validation, split.test)]
    assert not parts[0] & parts[1] and not parts[0] & parts[2]
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert card["transitions"] == 24 and card["groups_of_repeats"] == 16
    assert card["counts"]["surface"] == {"steel": 8, "wood": 16}


def test_a_data_set_has_its_outlines_with_it(
    rows: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_pushes_that_begin_inside_are_counted(rows: Recorded, tmp_path: Path) -> None:
    write_stated(tmp_path)
    inside = rows.tip_start.copy()
    inside[[3, 5]] = rows.before[[3, 5], :2]  # a corner of the outline, by its frame
    end = rows.tip_end + inside - rows.tip_start
    npz = write_npz(tmp_path / "all.npz", rows.changed(tip_start=inside, tip_end=end))
    data, printed = convert(tmp_path / "out", npz)
    assert len(data) == 22
    assert f"2 left out: the tool begins inside the body ({npz} row 4, {npz} row 6" in printed
    with pytest.raises(DatasetError, match=r"all.npz row 4: the tool begins 4.\d mm inside the bo"):
        convert(tmp_path / "other", npz, skip_bad=False)
    everywhere = rows.changed(tip_start=rows.before[:, :2], tip_end=rows.before[:, :2] + 0.02)
    npz = write_npz(tmp_path / "all.npz", everywhere)
    with pytest.raises(DatasetError, match="in all 24 rows the tool begins inside the body"):
        convert(tmp_path / "other", npz)


def test_shapes_of_the_library_need_a_radius(rows: Recorded, tmp_path: Path) -> None:
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
        (
            "before",
            1e3,
            r"row 1: before is \[.*\]; it looks like millimetres; give metres, up to 10",
        ),
        ("tip_end", 1e3, r"row 1: tip_end is \[.*\]; it looks like millimetres"),
        (
            "after",
            180 / np.pi,
            r"row \d+: heading after is -?\d+.*; it looks like degrees; give ra",
        ),
        ("speed", 1e3, r"row 1: speed is 20\.; allowed: 0.001 to 2 m/s; it looks like mm/s"),
        ("speed", 0.0, r"row 1: speed is 0\.; allowed: 0.001 to 2 m/s"),
        ("after", np.nan, r"row 1: after is \[nan nan nan\]; it must be finite"),
    ],
)
def test_numbers_that_cannot_be_are_refused(
    rows: Recorded, tmp_path: Path, name: str, factor: float, message: str
) -> None:
    write_stated(tmp_path)
    npz = write_npz(tmp_path / "all.npz", scaled(rows, name, factor))
    with pytest.raises(DatasetError, match=message):
        convert(tmp_path / "out", npz)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("theta1", "phi"), "header of .* lacks theta1; it needs object"),
        (lambda text: text[:-40], r"row 25 has \d+ fields; the header 14"),
        (lambda text: text.replace("0.02,", "slow,", 1), r"row 2: speed is 'slow'; give a number"),
        (lambda text: text.replace("knee", "", 1), "row 2: object is empty"),
        (lambda text: HEADER, "has a header and no pushes"),
        (lambda text: text.replace("knee", '"cor', 1), "is not read: "),
        (lambda text: text.replace(",tip_radius", "").replace(",0.00475", ""), "give --tip-radius"),
    ],
)
def test_a_csv_that_is_none_is_refused(
    rows: Recorded, tmp_path: Path, change: object, message: str
) -> None:
    shapes = write_stated(tmp_path)
    path = write_csv(tmp_path / "mine.csv", rows)
    path.write_text(change(path.read_text()))  # type: ignore[operator]
    with pytest.raises(DatasetError, match=message):
        read_recordings((path,), shapes)


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
        (
            "all.npz",
            lambda path: path.rename(path.with_suffix(".txt")) and path.mkdir(),
            "holds no",
        ),
    ],
)
def test_a_file_that_is_none_is_refused(
    rows: Recorded, tmp_path: Path, name: str, change: object, message: str
) -> None:
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
def test_the_public_pushes_are_read(tmp_path: Path) -> None:
    data, printed = convert(tmp_path / "out", Path(os.environ["SAIN_REAL_DATA"]))
    assert "11,323 pushes of 11 bodies; surfaces: abs 7,242, plywood 4,081" in printed
    assert "51 left out" in printed and "289 never touch the body" in printed
    assert len(data) == 11_272 and len(np.unique(data.episode)) == 6_029
    assert all(part.action.shape == (len(part), 8) for part in data.parts)
    assert {*ORIGINS, *SHAPED} <= set(Column)
