"""Predictions that are kept in a folder, so that an interrupted run goes on where it stopped.

What is kept is taken again only for the same data, fold, settings and sources of the model.
"""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.real.folds import Case, Fold
from benchmarks.real.pushes import Poses, PushTable
from benchmarks.real.rows import PARTS, Predicted, Row
from sain_core.scene import wrap_angle
from sain_core.storage import read_arrays, write_arrays
from sain_core.types import Indices, Scalars

SOURCES: Final = (  # that predictions depend on
    *(f"sain_model.{room}" for room in ("data", "dynamics", "importing", "inference", "network")),
    *("sain_model.physics", "sain_model.training", "sain_core.shapes", "benchmarks.real"),
)
DEGREE: Final = np.pi / 180.0
SHOWING: Final = ("page", "measures", "__main__")  # not of them


@dataclass(frozen=True)
class Step:
    """One row of one fold of one case: what is computed at a time."""

    case: Case
    fold: Fold
    row: Row

    @property
    def name(self) -> str:
        """What it is, for people."""
        return f"{self.case.title}: {self.row.title}, fold {self.fold.name}"

    def identity(self, pushes: PushTable) -> str:
        """Return a digest of all that the prediction depends on."""
        digest = hashlib.sha256(f"{pushes.data.sha256} {self.row.identity} {sources()}".encode())
        for rows in (self.fold.train, self.fold.own, self.fold.test):
            digest.update(pushes.row[rows].tobytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class Kept:
    """A folder with the predictions of steps."""

    folder: Path

    def path(self, step: Step) -> Path:
        """Return the file of a step."""
        return self.folder / step.case.key / step.fold.name / f"{step.row.key}.npz"

    def read(self, step: Step, pushes: PushTable) -> Predicted | None:
        """Return what is kept; None: nothing, or of other data, settings or sources."""
        if not self.path(step).exists():
            return None
        arrays = read_arrays(self.path(step))
        if str(arrays["identity"]) != step.identity(pushes):
            return None
        return Predicted(arrays["poses"], *(arrays.get(name) for name in PARTS[1:]))

    def write(self, step: Step, pushes: PushTable, found: Predicted, seconds: float) -> None:
        """Keep a prediction."""
        arrays = {"seconds": np.array(seconds), "identity": np.array(step.identity(pushes))}
        arrays |= {name: part for name in PARTS if (part := getattr(found, name)) is not None}
        write_arrays(self.path(step), arrays)

    def seconds(self, step: Step) -> float:
        """Return how long a step took that is kept."""
        return float(read_arrays(self.path(step))["seconds"])


@cache
def sources() -> str:
    """Return a digest of the sources that predictions are made with."""
    digest = hashlib.sha256()
    for package in SOURCES:
        for path in sorted(Path(str(resources.files(package))).glob("*.py")):
            if path.stem not in SHOWING:
                digest.update(path.read_bytes())
    return digest.hexdigest()


def all_steps(cases: Sequence[Case], rows: Sequence[Row]) -> list[Step]:
    """Return the steps of all cases, case by case."""
    return [
        Step(case, fold, row)
        for case in cases
        for row in rows_of(case, rows)
        for fold in case.folds
    ]


def rows_of(case: Case, rows: Sequence[Row]) -> list[Row]:
    """Return the rows that take part in a case."""
    return [row for row in rows if case.for_all or not row.learns_anew]


def compute(
    pushes: PushTable, steps: Sequence[Step], kept: Kept, say: Callable[[str], None]
) -> None:
    """Compute what is not kept, and say before each step what comes and how many are left."""
    missing = [step for step in steps if kept.read(step, pushes) is None]
    for place, step in enumerate(missing):
        say(f"{step.name} ({len(missing) - place} steps left)")
        begin = time.monotonic()
        train, own, test = (
            pushes.select(rows) for rows in (step.fold.train, step.fold.own, step.fold.test)
        )
        found = step.row.fit(train, own).predict(test)
        kept.write(step, pushes, found, time.monotonic() - begin)


# --- what it is worth -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a row predicted in all folds of a case, put together.

    Attributes:
        rows: numbers of the predicted pushes (T,), rising.
        predicted: what was predicted of them.
        mm: errors of the position (T,).
        degrees: errors of the heading (T,).
        seconds: that all folds took.
    """

    rows: Indices
    predicted: Predicted
    mm: Scalars
    degrees: Scalars
    seconds: float


def outcome(pushes: PushTable, case: Case, row: Row, kept: Kept) -> Outcome:
    """Return what is kept of a row of a case."""
    steps = [Step(case, fold, row) for fold in case.folds]
    found = [kept.read(step, pushes) for step in steps]
    whole = [one for one in found if one is not None]
    assert len(whole) == len(steps), "compute what is missing first"
    order = np.argsort(np.concatenate([fold.test for fold in case.folds]))
    rows = np.concatenate([fold.test for fold in case.folds])[order]
    predicted = Predicted(
        np.concatenate([one.poses for one in whole])[order],
        *(_joined([getattr(one, name) for one in whole], order) for name in ("radius", "turn")),
    )
    errors = pose_errors(predicted.poses, pushes.after[rows])
    return Outcome(rows, predicted, *errors, sum(map(kept.seconds, steps)))


def _joined(parts: Sequence[Any], order: Indices) -> Any:
    return None if any(part is None for part in parts) else np.concatenate(parts)[order]


def pose_errors(poses: Poses, truth: Poses) -> tuple[Scalars, Scalars]:
    """Return how far poses are off, in millimetres and degrees."""
    away = 1e3 * np.linalg.norm(poses[:, :2] - truth[:, :2], axis=1)
    return away, np.abs(wrap_angle(poses[:, 2] - truth[:, 2])) / DEGREE
