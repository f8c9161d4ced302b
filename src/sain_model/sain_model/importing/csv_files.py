"""A user's own recordings of pushes: CSV files with a header and a row for each push.

Numbers are in m, rad, m/s and kg, or in the units that the header states.
"""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import StringIO
from math import isfinite, nan, pi
from pathlib import Path
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.kinds import describe
from sain_core.guarding.plugins import nearest
from sain_core.guarding.untrusted import read_regular_text
from sain_core.scene import unit
from sain_model.importing.real_pushes import (
    LONGEST_TEXT,
    MOST_PUSHES,
    MOST_TURN,
    RealPushes,
)

POSES: Final = {
    "before": ("x0", "y0", "theta0"),
    "after": ("x1", "y1", "theta1"),
    "tip_start": ("tip_x0", "tip_y0"),
    "tip_end": ("tip_x1", "tip_y1"),
}
NUMBERS: Final = {  # columns and their units
    **{n: "rad" if "theta" in n else "m" for names in POSES.values() for n in names},
    "speed": "m/s",
}
# How a row may state what a tool is besides its one finger: a second finger at the start, and at
# the end as well; its distance and the heading to it; or a bar, of which the tip is the middle.
SECOND: Final = ("tip2_x0", "tip2_y0"), ("finger_distance", "finger_angle")
SECOND_END: Final = ("tip2_x1", "tip2_y1")
BAR: Final = ("bar_width", "bar_angle")
TOOLS: Final = (*SECOND, SECOND_END, BAR)
NOT_STATED: Final = {  # may be left empty
    "tip_radius": "m",
    **{n: "rad" if "angle" in n else "m" for names in TOOLS for n in names},
    "mass": "kg",
    "radius": "m",
}
ANGLES: Final = {
    "headings": ("theta0", "theta1"),
    "finger angles": ("finger_angle",),
    "bar angles": ("bar_angle",),
}
UNIT_OF: Final = NUMBERS | NOT_STATED
NEEDED: Final = ("object", *NUMBERS)
TEXTS: Final = ("surface", "object", "run")
OPTIONAL: Final = ("surface", "run", *NOT_STATED)
BYTE_ORDER: Final = "\ufeff"  # that some programs begin a file with


SEPARATORS: Final = ",;\t"
OTHERS: Final = {"|": "'|'", " ": "spaces", ":": "colons"}  # separators that are not read
HEAD_LINES: Final = 50  # in which a header is looked for
UNITS: Final = {  # that a header may state, and what they are in m, rad, m/s and kg
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "rad": {"rad": 1.0, "deg": pi / 180, "degrees": pi / 180},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3},
}
STATED: Final = re.compile(r"(\w+?)(?:[ _]+|[ _]*[\[(])([a-z]+(?:/s)?)[\])]?", re.IGNORECASE)
NEAR: Final = 0.8  # of the letters: a column that is meant by another name


@dataclass(frozen=True)
class Header:
    """The header of a CSV file."""

    names: tuple[str, ...]  # of its columns in order; empty for those that are not used
    factors: Mapping[str, float]  # what numbers of a column are multiplied with, by name
    unused: tuple[str, ...]  # columns that are left out, in words


def read_csv(path: Path, degrees: bool = False) -> tuple[RealPushes, list[str]]:
    """Return the pushes of a CSV file, and notes about what was not read as it stands.

    Commas, semicolons or tabs separate its columns. A header may state units: `x0_mm`, `x0 [mm]`.
    With `degrees`, headings without a unit are in degrees.

    Raises `DatasetError`: it does not exist, lacks a column, has too many rows, or a field that is
    missing or no number.
    """
    try:
        if what := describe(path, texts=False):
            raise DatasetError(f"{path} {what}")
        text = read_regular_text(path).removeprefix(BYTE_ORDER).lstrip("\r\n")
        text = text.replace("\r\n", "\n").replace("\r", "\n")
        separator = _separator(path, text)
        lines = csv.reader(StringIO(text, newline=""), strict=True, delimiter=separator)
        header = _header(path, next(lines, []), degrees)
        rows = list(_rows(path, lines, len(header.names), separator))
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist") from None
    except csv.Error as error:
        raise DatasetError(f"{path} line {lines.line_num} is not read: {error}") from error
    except (OSError, UntrustedFileError) as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    if not rows:
        raise DatasetError(f"{path} has a header and no pushes")
    numbered, fields = zip(*rows, strict=True)
    row = np.array(numbered)
    given = dict(zip(header.names, zip(*fields, strict=True), strict=True))
    notes = [f"{path}: {', '.join(header.unused)} not used"] if header.unused else []
    numbers = {name: given[name] for name in UNIT_OF if name in given}
    if separator != "," and any("," in text for texts in numbers.values() for text in texts):
        given |= _with_points(path, numbers, row)
        notes.append(f"{path}: decimal commas are read as points")
    pushes = _pushes(path, given, row, header.factors)
    return pushes, [*notes, *_small_degrees(path, given, row, header.factors)]


def _small_degrees(
    path: Path, given: "Fields", row: ndarray, factors: Mapping[str, float]
) -> Iterator[str]:
    """Yield a warning where all angles of a kind that are read as degrees could be radians."""
    for what, names in ANGLES.items():
        if any(factors.get(name, 1.0) == 1.0 for name in names):
            continue
        values = np.concatenate([_numbers(path, name, given[name], row) for name in names])
        if 0.0 < (most := np.abs(np.nan_to_num(values)).max()) <= MOST_TURN:
            yield (
                f"warning: {path}: {what} are read as degrees, and all are within {most:.3g}; if"
                " they are radians, give neither --degrees nor a unit in the header, or the unit"
                f" {names[0]}_rad"
            )


def _separator(path: Path, text: str) -> str:
    """Return what separates the columns of a table."""
    head = text.split("\n", HEAD_LINES)[:HEAD_LINES]
    signs = (*SEPARATORS, *OTHERS)
    pairs = ((place, sign) for place in range(len(head)) for sign in signs)  # the first of the best
    place, sign = max(pairs, key=lambda pair: _read_names(head[pair[0]], pair[1]))
    known = _read_names(head[place], sign)
    allowed = "allowed: a header, then a row for each push, with columns separated by commas,"
    allowed += " semicolons or tabs"
    if known and place:
        first = repr(head[0][:LONGEST_TEXT])
        raise DatasetError(
            f"{path} begins with {first}; its header is line {1 + place}: remove what is before it;"
            f" {allowed}"
        )
    if known and sign in OTHERS:
        raise DatasetError(f"{path} has columns separated by {OTHERS[sign]}; {allowed}")
    return sign


def _read_names(line: str, separator: str) -> int:
    """Return how many columns of a header have a name that is read."""
    texts = next(csv.reader([line], delimiter=separator), [])
    return sum(_stated(text)[0] in NEEDED + OPTIONAL for text in texts)


def _stated(text: str) -> tuple[str, str]:
    """Return name and unit that a header states; no unit: an empty one."""
    name = text.strip().lower()
    match = None if name in NEEDED + OPTIONAL else STATED.fullmatch(name)
    if match is not None and match[1] in UNIT_OF:
        return match[1], match[2]
    return name, ""


def _header(path: Path, texts: Sequence[str], degrees: bool) -> Header:
    """Return the columns of a header."""
    stated = [_stated(text) for text in texts]
    names = [name for name, _ in stated]
    needs = f"it needs {', '.join(NEEDED)}, once each, and may have {', '.join(OPTIONAL)}"
    unused, absent = list[str](), [name for name in NEEDED + OPTIONAL if name not in names]
    for place, name in enumerate(names):
        if name in NEEDED + OPTIONAL:
            if name in names[:place]:
                raise DatasetError(f"the header of {path} has {name} twice; {needs}")
            continue
        if near := nearest(name, absent, NEAR):
            raise DatasetError(f"the header of {path} has {name}; rename it to {near[0]}: {needs}")
        unused.append(f"column {name!r}" if name else f"column {place + 1}, which has no name,")
        names[place] = ""
    if missing := [name for name in NEEDED if name not in names]:
        raise DatasetError(f"the header of {path} lacks {', '.join(missing)}; {needs}")
    factors: dict[str, float] = {}
    for name, own in stated:
        if usual := UNIT_OF.get(name):
            if own and own not in UNITS[usual]:
                raise DatasetError(
                    f"the header of {path} has {name} in {own!r}; allowed:"
                    f" {', '.join(UNITS[usual])}"
                )
            plain = "deg" if degrees and usual == "rad" else usual
            factors[name] = UNITS[usual][own or plain]
    return Header(tuple(names), factors, tuple(unused))


def _rows(
    path: Path, lines: Iterator[list[str]], width: int, separator: str
) -> Iterator[tuple[int, list[str]]]:
    """Yield rows with their numbers; the header is row 1. Empty ones are left out."""
    for number, fields in enumerate(lines, start=2):
        if number > MOST_PUSHES + 1:
            raise DatasetError(f"{path} has more than {MOST_PUSHES:,} rows")
        if not any(field.strip() for field in fields):
            continue
        if len(fields) != width:
            hint = "; with decimal commas, separate columns by semicolons" * (separator == ",")
            raise DatasetError(
                f"{path} row {number} has {len(fields)} fields; the header {width}{hint}"
            )
        yield number, [field.strip() for field in fields]


Fields = dict[str, tuple[str, ...]]  # of each column


def _with_points(path: Path, numbers: Fields, row: ndarray) -> Fields:
    """Return columns of numbers with points in place of decimal commas."""
    for name, texts in numbers.items():
        for number, text in zip(row.tolist(), texts, strict=True):
            if "." in text or text.count(",") > 1:
                raise DatasetError(
                    f"{path} row {number}: {name} is {text!r}, and numbers of this file have"
                    " commas; write decimal points everywhere, and nothing between thousands"
                )
    return {name: tuple(text.replace(",", ".") for text in of) for name, of in numbers.items()}


def _pushes(path: Path, columns: Fields, row: ndarray, factors: Mapping[str, float]) -> RealPushes:
    count, empty = len(row), len(row) * ("",)
    texts = {name: np.array(columns.get(name, empty)) for name in TEXTS}
    for name, values in texts.items():
        for wrong in np.flatnonzero(np.char.str_len(values) > LONGEST_TEXT):
            raise DatasetError(f"{path} row {row[wrong]}: {name} is longer than {LONGEST_TEXT}")
    if not texts["object"].all():
        raise DatasetError(f"{path} row {row[np.argmin(texts['object'] != '')]}: object is empty")
    texts["run"] = np.where(texts["run"] == "", path.stem[:LONGEST_TEXT], texts["run"])
    numbers = {
        name: factors.get(name, 1.0) * _numbers(path, name, columns.get(name, empty), row)
        for name in UNIT_OF
    }
    poses = {key: np.column_stack([numbers.pop(n) for n in names]) for key, names in POSES.items()}
    stated = {names: np.column_stack([numbers.pop(n) for n in names]) for names in TOOLS}
    tool = _tools(path, row, stated, poses["tip_start"], poses["tip_end"])
    file = np.zeros(count, np.int64)
    return RealPushes(**texts, **poses, **numbers, **tool, file=file, row=row, files=(str(path),))


def _tools(
    path: Path, row: ndarray, stated: dict[tuple[str, str], ndarray], start: ndarray, end: ndarray
) -> dict[str, ndarray]:
    """Return span, bar and turn of tools from what rows state of them (M, 2), NaN where nothing."""
    given = {names: ~np.isnan(two) for names, two in stated.items()}
    for names, (one, other) in ((names, two.T) for names, two in given.items()):
        for place in np.flatnonzero(one != other)[:1]:
            has, lacks = names if one[place] else names[::-1]
            raise DatasetError(
                f"{path} row {row[place]} has {has} and no {lacks}; give both, or neither"
            )
    tip, polar, last, bar = (given[names][:, 0] for names in (*SECOND, SECOND_END, BAR))
    for place in np.flatnonzero((tip * 1 + polar + bar > 1) | (last & ~tip))[:1]:
        what = " and ".join(", ".join(names) for names in TOOLS if given[names][place, 0])
        raise DatasetError(
            f"{path} row {row[place]} has {what}; a tool has one finger, a second one"
            f" ({' or '.join(', '.join(names) for names in SECOND)}; with the first,"
            f" {', '.join(SECOND_END)} too), or is a bar ({', '.join(BAR)})"
        )
    span = np.where(tip[:, None], stated[SECOND[0]] - start, 0.0)
    for place in np.flatnonzero(tip & ~span.any(axis=1))[:1]:
        raise DatasetError(
            f"{path} row {row[place]}: the second finger is where the first one is; leave it empty"
            " for one finger"
        )
    for names in (SECOND[1], BAR):
        length, angle = np.nan_to_num(stated[names]).T
        for place in np.flatnonzero(given[names][:, 0] & (length <= 0.0))[:1]:
            raise DatasetError(
                f"{path} row {row[place]}: {names[0]} is {length[place]:g}; it must be positive;"
                " leave it empty for one finger"
            )
        for place in np.flatnonzero(np.abs(angle) > MOST_TURN)[:1]:
            raise DatasetError(
                f"{path} row {row[place]}: {names[1]} is {angle[place]:g}; it looks like degrees;"
                f" give radians, up to 2 pi, or the option --degrees, or a column {names[1]}_deg"
            )
        span += length[:, None] * unit(angle)
    off = np.where(last[:, None], stated[SECOND_END] - end - span, 0.0)
    return {"span": span, "bar": bar, "turn": np.linalg.norm(off, axis=1)}


def _numbers(path: Path, name: str, texts: tuple[str, ...], row: ndarray) -> ndarray:
    """Return a column of numbers (M,); NaN where one that may be left empty is."""
    numbers = np.full(len(texts), nan)
    for place, text in enumerate(texts):
        if not text and name in NOT_STATED:
            continue
        with suppress(ValueError):
            numbers[place] = float(text) if "_" not in text else nan
        if not isfinite(numbers[place]):
            what = repr(text[:LONGEST_TEXT])
            raise DatasetError(f"{path} row {row[place]}: {name} is {what}; give a finite number")
    return numbers
