"""Which files hold real pushes, and the bodies that were pushed.

A user's own recordings are a CSV file with a header, a row for each push, in m, rad, m/s and kg.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.errors import ConfigError, DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import read_regular_text
from sain_core.shapes.library import get_shape
from sain_core.shapes.outlines import BodyOutline, StatedBodies, read_stated
from sain_model.importing.mat_logs import read_mats
from sain_model.importing.real_pushes import (
    FOUND_AT,
    LONGEST_TEXT,
    MOST_PUSHES,
    PUBLISHED_TIP_RADIUS,
    RealPushes,
    check_real,
    is_one_push,
    joined,
    read_npz,
)

POSES: Final = {
    "before": ("x0", "y0", "theta0"),
    "after": ("x1", "y1", "theta1"),
    "tip_start": ("tip_x0", "tip_y0"),
    "tip_end": ("tip_x1", "tip_y1"),
}
NUMBERS: Final = (*(name for names in POSES.values() for name in names), "speed")
NEEDED: Final = ("object", *NUMBERS)
TEXTS: Final = ("surface", "object", "run")
OPTIONAL: Final = ("surface", "run", "tip_radius", "mass", "radius")
BYTE_ORDER: Final = "\ufeff"  # that some programs begin a file with
NOT_STATED: Final = ("tip_radius", "mass", "radius")  # may be left empty


def read_csv(path: Path) -> RealPushes:
    """Return the pushes of a CSV file.

    Raises:
        DatasetError: it does not exist, has no such header, a column that is not known, too many
            rows, or a field that is missing or no number.
    """
    try:
        text = read_regular_text(path).removeprefix(BYTE_ORDER)
        lines = csv.reader(StringIO(text, newline=""), strict=True)
        header = [name.strip() for name in next(lines, [])]
        _check_header(path, header)
        rows = list(_rows(path, lines, len(header)))
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist") from None
    except (OSError, UntrustedFileError, csv.Error) as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    if not rows:
        raise DatasetError(f"{path} has a header and no pushes")
    numbered, fields = zip(*rows, strict=True)
    row = np.array(numbered)
    columns = dict(zip(header, zip(*fields, strict=True), strict=True))
    return _pushes(path, columns, row)


def _check_header(path: Path, header: list[str]) -> None:
    missing = [name for name in NEEDED if name not in header]
    unknown = [name for name in header if name not in NEEDED + OPTIONAL]
    if missing or unknown or len(set(header)) < len(header):
        wrong = f"lacks {', '.join(missing)}" if missing else f"has {', '.join(unknown or header)}"
        raise DatasetError(
            f"the header of {path} {wrong}; it needs {', '.join(NEEDED)}, once each, and may have"
            f" {', '.join(OPTIONAL)}"
        )


def _rows(path: Path, lines: Iterator[list[str]], width: int) -> Iterator[tuple[int, list[str]]]:
    """Yield rows with their numbers; the header is row 1. Empty ones are left out."""
    for number, fields in enumerate(lines, start=2):
        if number > MOST_PUSHES + 1:
            raise DatasetError(f"{path} has more than {MOST_PUSHES:,} rows")
        if fields and len(fields) != width:
            raise DatasetError(f"{path} row {number} has {len(fields)} fields; the header {width}")
        if fields:
            yield number, [field.strip() for field in fields]


def _pushes(path: Path, columns: dict[str, tuple[str, ...]], row: ndarray) -> RealPushes:
    count = len(row)
    texts = {}
    for name in TEXTS:
        texts[name] = np.array(columns.get(name, count * ("",)))
        for wrong in np.flatnonzero(np.char.str_len(texts[name]) > LONGEST_TEXT):
            raise DatasetError(f"{path} row {row[wrong]}: {name} is longer than {LONGEST_TEXT}")
    if not texts["object"].all():
        raise DatasetError(f"{path} row {row[np.argmin(texts['object'] != '')]}: object is empty")
    texts["run"] = np.where(texts["run"] == "", path.stem[:LONGEST_TEXT], texts["run"])
    numbers = {name: _numbers(path, name, columns[name], row) for name in NUMBERS}
    for name in NOT_STATED:
        given = columns.get(name, count * ("",))
        numbers[name] = _numbers(path, name, tuple(text or "nan" for text in given), row)
    poses = {key: np.column_stack([numbers.pop(n) for n in names]) for key, names in POSES.items()}
    file = np.zeros(count, np.int64)
    return RealPushes(**texts, **poses, **numbers, file=file, row=row, files=(str(path),))


def _numbers(path: Path, name: str, texts: tuple[str, ...], row: ndarray) -> ndarray:
    try:
        return np.array(texts, dtype=np.float64)
    except ValueError:
        for number, text in zip(row.tolist(), texts, strict=True):
            try:
                float(text)
            except ValueError:
                what = repr(text[:LONGEST_TEXT])
                raise DatasetError(
                    f"{path} row {number}: {name} is {what}; give a number"
                ) from None
        raise


NPZ, MAT, CSV = SUFFIXES = (".npz", ".mat", ".csv")
BESIDE: Final = ("shapes.json", "shapes.yaml")  # where outlines stand if no file is named
MOST_FILES: Final = 10_000

BodyKey = tuple[str, float]  # name, and the radius [m] that a row states; NaN: none


@dataclass(frozen=True)
class Recordings:
    """What was read.

    Attributes:
        pushes: of all files.
        bodies: by name and stated radius of each row's body.
        keys: of each row.
        notes: lines about what was left out or turned round.
        paths: the files.
    """

    pushes: RealPushes
    bodies: dict[BodyKey, BodyOutline]
    keys: list[BodyKey]
    notes: tuple[str, ...]
    paths: tuple[Path, ...]


def read_recordings(
    paths: Sequence[Path], shapes: Path | None = None, tip_radius: float | None = None
) -> Recordings:
    """Read files and folders of real pushes.

    Args:
        paths: of files, or of folders of them.
        shapes: file of outlines; None: one of `BESIDE` next to the first path, or none.
        tip_radius: of the tool where rows do not state it [m]; None: that of the file of outlines,
            or of the laboratory that published the form.

    Raises:
        DatasetError: nothing there, a file that is damaged or of another form, a number that
            cannot be, a body without an outline, or a tool without a radius.
    """
    found, notes = _find(paths)
    logs = [path for path in found if path.suffix == MAT]
    read = dict(zip(logs, read_mats(logs), strict=True))
    read |= {path: read_npz(path) for path in found if path.suffix == NPZ}
    read |= {path: read_csv(path) for path in found if path.suffix == CSV}
    pushes = joined([read[path] for path in found])
    if (same := pushes.same_as_before()).any():
        notes.append(f"{same.sum():,} rows state a push of another row once more: left out")
        pushes = pushes.select(~same)
    if shapes is None:
        folder = paths[0] if paths[0].is_dir() else paths[0].parent
        shapes = next((folder / name for name in BESIDE if (folder / name).exists()), None)
    stated = read_stated(shapes) if shapes else StatedBodies({})
    _complete_radii(pushes, stated.tip_radius if tip_radius is None else tip_radius)
    pushes = check_real(pushes)
    bodies, keys = _bodies(pushes, stated, shapes)
    notes += [
        f"the outline of {name!r} runs clockwise: turned round"
        for (name, _), body in bodies.items()
        if body.clockwise
    ]
    return Recordings(pushes, bodies, keys, tuple(notes), tuple(found))


def _find(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files, and notes about those of a folder that are of another form."""
    found, notes = list[Path](), list[str]()
    if not paths:
        raise DatasetError("give one or more files of pushes, or folders of them")
    for path in paths:
        if not path.exists():
            raise DatasetError(f"{path} does not exist; {FOUND_AT}")
        if not path.is_dir():
            if path.suffix not in SUFFIXES:
                raise DatasetError(f"{path} is no file of pushes; allowed: {', '.join(SUFFIXES)}")
            found.append(path)
            continue
        inside = [file for file in sorted(path.iterdir()) if file.suffix in SUFFIXES]
        for file in inside:
            if file.suffix == NPZ and not is_one_push(file):
                notes.append(f"{file} is of another form: left out")
            else:
                found.append(file)
        if not inside:
            raise DatasetError(f"{path} holds no {', '.join(SUFFIXES)}; {FOUND_AT}")
    if not 0 < len(found) <= MOST_FILES:
        raise DatasetError(f"{len(found)} files of pushes were found; allowed: 1 to {MOST_FILES}")
    return found, notes


def _complete_radii(pushes: RealPushes, tip_radius: float | None) -> None:
    """Fill in the radius of the tool where rows do not state it; the published form has its own."""
    unknown = np.isnan(pushes.tip_radius)
    if tip_radius is not None:
        pushes.tip_radius[unknown] = tip_radius
        return
    own = np.array([Path(file).suffix != CSV for file in pushes.files])[pushes.file]
    pushes.tip_radius[unknown & own] = PUBLISHED_TIP_RADIUS
    if (missing := unknown & ~own).any():
        row = pushes.where(int(np.argmax(missing)))
        raise DatasetError(
            f"{row} does not state the radius of the tool; give --tip-radius or a column tip_radius"
        )


def _bodies(
    pushes: RealPushes, stated: StatedBodies, shapes: Path | None
) -> tuple[dict[BodyKey, BodyOutline], list[BodyKey]]:
    """Return the bodies of the rows: stated ones, or shapes of the library with a radius."""
    bodies: dict[BodyKey, BodyOutline] = {}
    keys = []
    pairs = zip(pushes.object.tolist(), np.nan_to_num(pushes.radius).tolist(), strict=True)
    for index, (name, radius) in enumerate(pairs):
        key = (name, 0.0 if name in stated.bodies else radius)
        keys.append(key)
        if key in bodies:
            continue
        if name in stated.bodies:
            bodies[key] = stated.bodies[name]
            continue
        where = f"{shapes} states no" if shapes else "no file (--shapes) states an"
        try:
            shape = get_shape(name)
        except ConfigError as error:
            raise DatasetError(
                f"{pushes.where(index)}: {where} outline of {name!r}, and it is no shape of the"
                " library"
            ) from error
        if not radius:
            raise DatasetError(
                f"{pushes.where(index)}: {where} outline of {name!r}; for the shape of the library"
                " give its circumscribed radius [m] in the column radius"
            )
        bodies[key] = BodyOutline(shape, radius / shape.circumradius, (0.0, 0.0))
    return bodies, keys
