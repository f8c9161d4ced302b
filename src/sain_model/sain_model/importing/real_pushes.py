"""Pushes as a laboratory recorded them: one body on a surface, poses before and after, the tool.

Zhou et al. published real pushes as an ``.npz`` of many of their logs, with `COLUMNS` in m, rad and
m/s. The logs themselves are in `importing.mat_logs`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import pi
from pathlib import Path
from typing import Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.guarding.untrusted import LEAST_RADIUS, MOST_RADIUS
from sain_core.push import LENGTH, SPEED, TIP_RADIUS, allowed_ranges
from sain_core.scene import unit, wrap_angle
from sain_core.shapes.body_file import LEAST_MASS, MOST_MASS
from sain_core.storage import read_arrays
from sain_core.types import Indices, Mask

FARTHEST: Final = 10.0  # [m], of a place on a table; farther away it is no metre
MOST_TURN: Final = 2 * pi + 1e-6  # [rad], of a heading; beyond it is no radian
IN_DEGREES: Final = "of a CSV file the option --degrees, or the columns theta0_deg and theta1_deg"
LONGEST_TEXT: Final = 64
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

    def select(self, rows: Mask | Indices) -> Self:
        """Return some of the pushes."""
        arrays = [item.name for item in fields(self) if item.name != "files"]
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})

    @property
    def length(self) -> Float[ndarray, "M"]:
        """The tool's way [m]."""
        return np.asarray(np.linalg.norm(self.tip_end - self.tip_start, axis=1))

    @property
    def heading(self) -> Float[ndarray, "M"]:
        """The way's heading [rad]."""
        x, y = (self.tip_end - self.tip_start).T
        return np.asarray(np.arctan2(y, x))

    def in_body(self, places: Float[ndarray, "M 2"]) -> Float[ndarray, "M 2"]:
        """Return places seen from the body before the push."""
        cos, sin = unit(self.before[:, 2]).T
        x, y = (places - self.before[:, :2]).T
        return np.column_stack([cos * x + sin * y, cos * y - sin * x])

    def same_as_before(self) -> Mask:
        """Return which pushes (M,) are stated in an earlier row, too, to the bit."""
        exact = (self.before, self.after, self.tip_start, self.tip_end, self.speed[:, None])
        numbers = map(bytes, np.ascontiguousarray(np.hstack(exact)))
        texts = zip(self.surface.tolist(), self.object.tolist(), numbers, strict=True)
        seen = {push: row for row, push in reversed([*enumerate(texts)])}
        same = np.ones(len(self), dtype=bool)
        same[[*seen.values()]] = False
        return same


def joined(parts: Sequence[RealPushes]) -> RealPushes:
    """Return the pushes of many files."""
    files: list[str] = []
    numbered = []
    for part in parts:
        numbered.append(part.file + len(files))
        files += part.files
    values = {
        item.name: np.concatenate([getattr(part, item.name) for part in parts])
        for item in fields(RealPushes)
        if item.name not in ("file", "files")
    }
    return RealPushes(**values, file=np.concatenate(numbered), files=tuple(files))


def check_real(pushes: RealPushes) -> RealPushes:
    """Return pushes that can be, with headings in (-pi, pi].

    Raises `DatasetError`: naming the row and the value of the first that is NaN or Inf, looks like
    millimetres or degrees, or is out of range.
    """
    for name in ("before", "after", "tip_start", "tip_end", "speed"):
        values = getattr(pushes, name)
        finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
        _refuse(pushes, ~finite, name, values, "it must be finite")
    for name in ("before", "after", "tip_start", "tip_end"):
        places = getattr(pushes, name)[:, :2]
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
        name, values, what = numbers[column]
        allowed = f"allowed: {least:g} to {most:g} {what}"
        _refuse(pushes, values > most, name, values, f"{allowed}; it looks like m{what}")
        _refuse(pushes, ~(values >= least), name, values, allowed)
    for name, least, most, hint in (
        ("mass", LEAST_MASS, MOST_MASS, "kg; 500 g are 0.5"),
        ("radius", LEAST_RADIUS, MOST_RADIUS, "m; 80 mm are 0.08"),
    ):
        values = getattr(pushes, name)
        wrong = (values < least) | (values > most)
        _refuse(pushes, wrong, name, values, f"allowed: {least:g} to {most:g} {hint}")


def _refuse(pushes: RealPushes, wrong: Mask, name: str, values: ndarray, hint: str) -> None:
    if wrong.any():
        index = int(np.argmax(wrong))
        value = np.array2string(np.asarray(values[index]), precision=5)
        raise DatasetError(f"{pushes.where(index)}: {name} is {value}; {hint}")


COLUMNS: Final = {  # of the npz: numbers of a row; none: text
    "surface": None,
    "shape": None,
    "speed": 0,
    "init_pose": 3,
    "final_pose": 3,
    "tip_init": 2,
    "tip_final": 2,
}
PUBLISHED_TIP_RADIUS: Final = 0.00475  # [m], of that laboratory's tool, which no file states
MOST_PUSHES: Final = 1_000_000


def is_one_push(path: Path) -> bool:
    """Return whether an npz is of this form; raises `DatasetError` where it is damaged."""
    return set(COLUMNS) <= set(read_arrays(path))


def read_npz(path: Path) -> RealPushes:
    """Return the pushes of an npz; raises `DatasetError`: it is damaged, or of another form."""
    arrays = read_arrays(path)
    if missing := [name for name in COLUMNS if name not in arrays]:
        raise DatasetError(f"{path} is of another form: it lacks {', '.join(missing)}")
    count = len(arrays["speed"]) if arrays["speed"].ndim else 0
    if not 0 < count <= MOST_PUSHES:
        raise DatasetError(f"{path} has {count} pushes; allowed: 1 to {MOST_PUSHES:,}")
    for name, size in COLUMNS.items():
        shape = (count, size) if size else (count,)
        kinds, wanted = ("U", "text") if size is None else ("fiu", "real numbers")
        found = arrays[name]
        if found.shape != shape or found.dtype.kind not in kinds:
            raise DatasetError(
                f"{path}: {name} is {found.dtype} of shape {found.shape}; it should be {wanted} of"
                f" shape {shape}"
            )
    poses = [arrays[name].astype(np.float64) for name in list(COLUMNS)[2:]]
    return published_pushes(path, arrays["surface"], arrays["shape"], *poses)


def published_pushes(
    path: Path, surface: ndarray, body: ndarray, speed: ndarray, *poses: ndarray
) -> RealPushes:
    """Return pushes of a published file; poses are before and after, then the tool's ends."""
    count = len(speed)
    unknown = np.full(count, np.nan)
    runs = (
        f"{ground}_{name}_v{1e3 * fast:g}"
        for ground, name, fast in zip(surface.tolist(), body.tolist(), speed.tolist(), strict=True)
    )
    before, after, tip_start, tip_end = poses
    return RealPushes(
        surface,
        body,
        np.array(list(runs)),
        before,
        after,
        tip_start,
        tip_end,
        speed,
        unknown.copy(),
        unknown,
        unknown,
        np.zeros(count, np.int64),
        np.arange(count) + 1,
        (str(path),),
    )
