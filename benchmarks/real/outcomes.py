"""What a row predicted in all folds of a case, put together, and how far it is off."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from benchmarks.real.folds import Case
from benchmarks.real.kept import Kept, Step
from benchmarks.real.pushes import Poses, PushTable
from benchmarks.real.rows import Predicted, Row
from sain_core.scene import wrap_angle
from sain_core.types import Indices, Scalars

DEGREE: Final = np.pi / 180.0


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
