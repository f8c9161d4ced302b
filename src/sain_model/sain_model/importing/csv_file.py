"""A user's own recordings: a CSV file with a header, a row for each push, in m, rad, m/s and kg."""

import csv
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import read_regular_text
from sain_model.importing.one_push_files import MOST_PUSHES
from sain_model.importing.real_pushes import LONGEST_TEXT, RealPushes

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
