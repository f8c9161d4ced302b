"""Pushes as a laboratory recorded them: one body on a surface, poses before and after, the tool.

Zhou et al. published pushes as an ``.npz`` of many of their logs with `COLUMNS` in m, rad and m/s,
and the logs: MATLAB files of one surface, body and speed, with ``surface_type``, ``shape_id``,
``vel`` [mm/s] and ``record_all``, a struct for each push. SciPy reads logs, and crashes on some
damaged ones. So a process of its own reads them, which may only use so much memory.
"""

import resource
import zlib
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from io import BytesIO
from math import pi
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import (
    LEAST_RADIUS,
    MIB,
    MOST_RADIUS,
    limit,
    read_regular,
    unpacked_bytes,
)
from sain_core.push import LENGTH, MOST_SPAN, SPEED, TIP_RADIUS, allowed_ranges
from sain_core.scene import turned, wrap_angle
from sain_core.shapes.outlines import LEAST_MASS, MOST_MASS
from sain_core.storage import DAMAGE, read_arrays
from sain_core.types import Indices, Mask

CLOSED: Final = 1e-3  # [m], by which fingers that touch may be measured too near
FARTHEST: Final = 10.0  # [m], of a place on a table; farther away it is no metre
MOST_TURN: Final = 2 * pi + 1e-6  # [rad], of a heading; beyond it is no radian
IN_DEGREES: Final = "of a CSV file the option --degrees, or the columns theta0_deg and theta1_deg"
LONGEST_TEXT: Final = 64
MOST_PUSHES: Final = 1_000_000  # of a file
FOUND_AT: Final = (
    "the public pushes of Yu et al. (2016) are in folder mcube_data_proc/motion_model_eval_logs of"
    " github.com/robinzhoucmu/PlanarManipulationToolBox"
)


@dataclass(frozen=True, eq=False)
class RealPushes:
    """M pushes, in the frame of the body that its user states."""

    surface: ndarray  # name (M,); empty where it is not stated
    object: ndarray  # name of the pushed body (M,)
    run: ndarray  # name of the recording (M,)
    before: Float[ndarray, "M 3"]  # pose of the body x, y [m] and heading [rad], (M, 3)
    after: Float[ndarray, "M 3"]  # likewise
    tip_start: Float[ndarray, "M 2"]  # where the tool's axis began (M, 2) [m]
    tip_end: Float[ndarray, "M 2"]  # where it ended
    speed: Float[ndarray, "M"]  # of the tool (M,) [m/s]
    tip_radius: Float[ndarray, "M"]  # of the tool (M,) [m]; NaN: not stated
    # from the axis of one finger to that of the other, or along a bar of which the tip is the
    # middle, as wide as it is on the outside (M, 2) [m]; zeros: one finger
    span: Float[ndarray, "M 2"]
    bar: Mask  # which tools are bars (M,)
    turn: Float[ndarray, "M"]  # by how much the ways of two fingers differ (M,) [m]
    mass: Float[ndarray, "M"]  # of the body (M,) [kg]; NaN: not stated
    # circumscribed, of a body whose shape is one of the library's (M,) [m]; NaN likewise
    radius: Float[ndarray, "M"]
    file: Int[ndarray, "M"]  # number of the file that each is from, (M,)
    row: Int[ndarray, "M"]  # its number there, as people count it
    files: tuple[str, ...]  # names of the files

    def __len__(self) -> int:
        return len(self.speed)

    def where(self, index: int) -> str:
        """Return in words where a push is."""
        return f"{self.files[int(self.file[index])]} row {self.row[index]}"

    @property
    def arrays(self) -> dict[str, ndarray]:
        """All columns by name; each has one row a push."""
        return {name: array for name, array in vars(self).items() if name != "files"}

    def select(self, rows: Mask | Indices) -> Self:
        """Return some of the pushes."""
        return replace(self, **{name: array[rows] for name, array in self.arrays.items()})

    @property
    def length(self) -> Float[ndarray, "M"]:
        """The tool's way [m]."""
        return np.asarray(np.linalg.norm(self.tip_end - self.tip_start, axis=1))

    @property
    def heading(self) -> Float[ndarray, "M"]:
        """The way's heading [rad]."""
        x, y = (self.tip_end - self.tip_start).T
        return np.asarray(np.arctan2(y, x))

    @property
    def axes(self) -> Float[ndarray, "M 2"]:
        """The way from the axis of the tool's first disk to that of the second [m]."""
        width = np.linalg.norm(self.span, axis=1)
        ends = np.where(self.bar, 2.0 * self.tip_radius, 0.0)
        return np.asarray(self.span * (1.0 - ends / np.where(self.bar, width, 1.0))[:, None])

    def first_disk(self, tip: Float[ndarray, "M 2"]) -> Float[ndarray, "M 2"]:
        """Return where the axis of the tool's first disk is when its tip is at places [m]."""
        return np.asarray(tip - np.where(self.bar, 0.5, 0.0)[:, None] * self.axes)

    def in_body(self, places: Float[ndarray, "M 2"]) -> Float[ndarray, "M 2"]:
        """Return places seen from the body before the push."""
        return turned(places - self.before[:, :2], -self.before[:, 2])

    def same_as_before(self) -> Mask:
        """Return which pushes (M,) are stated in an earlier row, too, to the bit."""
        own = np.column_stack([self.speed, self.span, self.bar])
        exact = (self.before, self.after, self.tip_start, self.tip_end, own)
        numbers = map(bytes, np.ascontiguousarray(np.hstack(exact)))
        texts = zip(self.surface.tolist(), self.object.tolist(), numbers, strict=True)
        seen = {push: row for row, push in reversed([*enumerate(texts)])}
        same = np.ones(len(self), dtype=bool)
        same[[*seen.values()]] = False
        return same


def joined(parts: Sequence[RealPushes]) -> RealPushes:
    """Return the pushes of many files."""
    firsts = np.cumsum([0, *(len(part.files) for part in parts)])
    numbered = [replace(p, file=p.file + n) for p, n in zip(parts, firsts[:-1], strict=True)]
    columns = [part.arrays for part in numbered]
    values = {name: np.concatenate([one[name] for one in columns]) for name in columns[0]}
    return RealPushes(**values, files=tuple(file for part in parts for file in part.files))


def check_real(pushes: RealPushes) -> RealPushes:
    """Return pushes that can be, with headings in (-pi, pi].

    Raises `DatasetError`: naming the row and the value of the first that is NaN or Inf, looks like
    millimetres or degrees, or is out of range.
    """
    for name in ("before", "after", "tip_start", "tip_end", "speed", "span"):
        values = getattr(pushes, name)
        finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
        _refuse(pushes, ~finite, name, values, "it must be finite")
    tip = {"second finger": pushes.tip_start + pushes.span}
    for name in ("before", "after", "tip_start", "tip_end", *tip):
        places = tip[name] if name in tip else getattr(pushes, name)[:, :2]
        _refuse(
            pushes, np.abs(places).max(axis=1, initial=0.0) > FARTHEST, name, places,
            f"it looks like millimetres; give metres, up to {FARTHEST:g} m",
        )  # fmt: skip
    for name in ("before", "after"):
        heading = getattr(pushes, name)[:, 2]
        _refuse(
            pushes, np.abs(heading) > MOST_TURN, f"heading {name}", heading,
            f"it looks like degrees; give radians, up to 2 pi, or {IN_DEGREES}",
        )  # fmt: skip
    _check_ranges(pushes)
    before, after = (
        np.column_stack([poses[:, :2], wrap_angle(poses[:, 2])])
        for poses in (pushes.before, pushes.after)
    )
    return replace(pushes, before=before, after=after)


def _check_ranges(pushes: RealPushes) -> None:
    numbers = {
        LENGTH: ("length of the tool's way", pushes.length, "m"),
        SPEED: ("speed", pushes.speed, "m/s"),
        TIP_RADIUS: ("tip_radius", pushes.tip_radius, "m"),
    }
    for column, least, most in allowed_ranges(stroke=True):
        if column not in numbers:
            continue
        name, values, what = numbers[column]
        allowed = f"allowed: {least:g} to {most:g} {what}"
        _refuse(pushes, values > most, name, values, f"{allowed}; it looks like m{what}")
        _refuse(pushes, ~(values >= least), name, values, allowed)
    _check_spans(pushes)
    for name, least, most, hint in (
        ("mass", LEAST_MASS, MOST_MASS, "kg; 500 g are 0.5"),
        ("radius", LEAST_RADIUS, MOST_RADIUS, "m; 80 mm are 0.08"),
    ):
        values = getattr(pushes, name)
        wrong = (values < least) | (values > most)
        _refuse(pushes, wrong, name, values, f"allowed: {least:g} to {most:g} {hint}")


def _check_spans(pushes: RealPushes) -> None:
    """Check that fingers are at least side by side, and bars at least as wide as they are round."""
    width = np.linalg.norm(pushes.span, axis=1)
    least = 2.0 * pushes.tip_radius - np.where(pushes.bar, 0.0, CLOSED)
    allowed = f"allowed: 2 tip_radius to {MOST_SPAN:g} m"
    for bar, name in ((False, "distance of the fingers' axes"), (True, "bar_width")):
        two = (pushes.bar == bar) & (bar | (pushes.span != 0.0).any(axis=1))
        _refuse(pushes, two & (width > MOST_SPAN), name, width, f"{allowed}; it looks like mm")
        hint = allowed if bar else f"{allowed}; leave it empty for one finger"
        _refuse(pushes, two & (width < least), name, width, hint)


def _refuse(pushes: RealPushes, wrong: Mask, name: str, values: ndarray, hint: str) -> None:
    if wrong.any():
        index = int(np.argmax(wrong))
        value = np.array2string(np.asarray(values[index]), precision=5)
        raise DatasetError(f"{pushes.where(index)}: {name} is {value}; {hint}")


# --- published files ------------------------------------------------------------------------------

COLUMNS: Final = {  # numbers of a row; none: text
    "surface": None,
    "shape": None,
    "speed": 0,
    "init_pose": 3,
    "final_pose": 3,
    "tip_init": 2,
    "tip_final": 2,
}
SECOND_TIP: Final = "tip2_init"  # of pushes with two fingers; NaN: one
RECORD: Final = {  # fields of a log's structs; a second finger's may be missing
    "init_pose": "init_pose_gt",
    "final_pose": "final_pose_gt",
    "tip_init": "init_tip_pt",
    "tip_final": "final_tip_pt",
    SECOND_TIP: "init_tip2_pt",
}
PUBLISHED_TIP_RADIUS: Final = 0.00475  # [m], of that laboratory's tool, which no file states

MOST_BYTES: Final = 64 * MIB  # of a log
MEMORY: Final = 4096 * MIB  # of the process
PATIENCE: Final = 600.0  # [s], for a log
COMPRESSED: Final = 15  # type of an element of a MATLAB file
MAT_HEADER: Final = 128  # bytes
PIECE: Final = 1 << 16


def is_published(path: Path) -> bool:
    """Return whether an npz is of this form; raises `DatasetError` where it is damaged."""
    return set(COLUMNS) <= set(read_arrays(path))


def read_npz(path: Path, tip_radius: float = PUBLISHED_TIP_RADIUS) -> RealPushes:
    """Return the pushes of an npz; raises `DatasetError`: it is damaged, or of another form."""
    return _pushes(path, read_arrays(path), tip_radius)


def read_logs(paths: Sequence[Path], tip_radius: float = PUBLISHED_TIP_RADIUS) -> list[RealPushes]:
    """Return the pushes of each log.

    Raises `DatasetError`: one is damaged, too large, or of another form.
    """
    found = []
    with ProcessPoolExecutor(1, get_context("spawn"), _limit_process) as process:
        for path in paths:
            try:
                arrays = process.submit(_read_log, path).result(PATIENCE)
            except BrokenProcessPool:
                raise DatasetError(
                    f"{path} is not a whole MATLAB file: SciPy crashes on it"
                ) from None
            except TimeoutError as error:
                raise DatasetError(f"{path} was not read in {PATIENCE:g} s") from error
            found.append(_pushes(path, arrays, tip_radius))
    return found


def _pushes(path: Path, arrays: dict[str, ndarray], tip_radius: float) -> RealPushes:
    """Return pushes of these columns; raises `DatasetError`: they are of another form."""
    if missing := [name for name in COLUMNS if name not in arrays]:
        raise DatasetError(f"{path} is of another form: it lacks {', '.join(missing)}")
    count = len(arrays["speed"]) if arrays["speed"].ndim else 0
    if not 0 < count <= MOST_PUSHES:
        raise DatasetError(f"{path} has {count} pushes; allowed: 1 to {MOST_PUSHES:,}")
    arrays = {SECOND_TIP: np.full((count, 2), np.nan), **arrays}
    for name, size in {**COLUMNS, SECOND_TIP: 2}.items():
        shape = (count, size) if size else (count,)
        kinds, wanted = ("U", "text") if size is None else ("fiu", "real numbers")
        found = arrays[name]
        if found.shape != shape or found.dtype.kind not in kinds:
            raise DatasetError(
                f"{path}: {name} is {found.dtype} of shape {found.shape}; it should be {wanted} of"
                f" shape {shape}"
            )
    surface, body, *numbers = (arrays[name] for name in (*COLUMNS, SECOND_TIP))
    speed, before, after, start, end, second = (array.astype(np.float64) for array in numbers)
    one = np.isnan(second).all(axis=1, keepdims=True)
    span = np.where(one, 0.0, second - start)
    names = zip(surface.tolist(), body.tolist(), speed.tolist(), strict=True)
    run = np.array([f"{ground}_{name}_v{1e3 * fast:g}" for ground, name, fast in names])
    radius, unknown = np.full(count, tip_radius), np.full(count, np.nan)
    places = np.zeros(count, np.int64), np.arange(count) + 1
    tool = radius, span, np.zeros(count, dtype=bool), np.zeros(count)
    columns = surface, body, run, before, after, start, end, speed, *tool, unknown, unknown
    return RealPushes(*columns, *places, (str(path),))


# --- in the process -------------------------------------------------------------------------------


def _limit_process() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _read_log(path: Path) -> dict[str, ndarray]:
    """Return the columns of a log."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        raw = read_regular(path, MOST_BYTES)
        _check_unpacked(raw)
        content: dict[str, Any] = loadmat(BytesIO(raw), simplify_cells=True)
        records = np.atleast_1d(np.asarray(content["record_all"], dtype=object)).ravel()
        columns = {
            name: np.array([record[key] for record in records], np.float64)
            for name, key in RECORD.items()
            if name != SECOND_TIP or key in records[0]
        }
        for name, key in (("surface", "surface_type"), ("shape", "shape_id")):
            columns[name] = np.full(len(records), str(content[key])[:LONGEST_TEXT])
        return columns | {"speed": np.full(len(records), 1e-3 * float(content["vel"]))}
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    except (*DAMAGE, MatReadError, TypeError, IndexError, AttributeError) as error:
        raise DatasetError(f"{path} is not a whole MATLAB file: {error}") from error


def _check_unpacked(raw: bytes) -> None:
    """Check that what is compressed does not unpack to more than it may."""
    place, unpacked, most = MAT_HEADER, 0, unpacked_bytes(len(raw))
    while place + 8 <= len(raw):
        kind, size = np.frombuffer(raw, "<u4", 2, place).tolist()
        if kind == COMPRESSED:
            stream, rest = zlib.decompressobj(), raw[place + 8 : place + 8 + size]
            while rest and not stream.eof:
                unpacked += len(stream.decompress(rest, PIECE))
                limit("bytes in its arrays", unpacked, most)
                rest = stream.unconsumed_tail
        place += 8 + size
