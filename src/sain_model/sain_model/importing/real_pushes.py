"""Pushes as a laboratory recorded them: one body on a surface, poses before and after, the tool."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.guarding.untrusted import LEAST_RADIUS, MOST_RADIUS
from sain_core.push import LENGTH, SPEED, TIP_RADIUS, allowed_ranges
from sain_core.scene import unit, wrap_angle
from sain_core.shapes.body_file import LEAST_MASS, MOST_MASS
from sain_core.types import Indices, Mask

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
