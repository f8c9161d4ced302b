"""Errors of rollouts after so many pushes: statistics, intervals over episodes, ratios."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.scene import MID, TARGET
from sain_core.types import Mask
from sain_model.data.windows import Windows
from sain_model.evaluation.metrics import (
    heading_errors,
    position_errors,
    ratio_over_episodes,
    statistics,
    target_moved,
)

PARTS: Final = ("all", "contact made", "contact missed", "3 pushes before and more")
ENOUGH: Final = 3  # earlier pushes

Predictions = Mapping[str, Float[ndarray, "W T N 8"]]


def errors_after(
    windows: Windows, predictions: Predictions, earlier: Int[ndarray, "W"], step: int, seed: int
) -> dict[str, Any]:
    """Return the errors after so many pushes, over windows that are as long.

    ``contact made`` are windows whose pushes moved the target by more than 2 mm in all.

    Args:
        windows: what happened.
        predictions: (W, T, N, 8) of each predictor.
        earlier: how many pushes came before each window.
        step: after how many pushes, from 1.
        seed: of the bootstrap.
    """
    long_enough = windows.known[:, step - 1]
    moved = target_moved(windows.scenes, windows.next_scenes[:, step - 1])
    masks = (long_enough, moved, ~moved, earlier >= ENOUGH)
    return {
        part: {
            name: row
            for name, predicted in predictions.items()
            if (row := _row(windows, predicted, long_enough & mask, step, seed))
        }
        for part, mask in zip(PARTS, masks, strict=True)
    }


def _row(
    windows: Windows, predicted: ndarray, rows: Mask, step: int, seed: int
) -> dict[str, Any] | None:
    """Return the errors of one predictor; None where it says nothing of any window."""
    rows = rows & np.isfinite(predicted[:, step - 1]).all(axis=(1, 2))
    if not rows.any():
        return None
    said, truth = predicted[rows, step - 1], windows.next_scenes[rows, step - 1]
    turned = heading_errors(said, truth)
    episodes = windows.episodes[rows]
    return {
        "windows": int(rows.sum()),
        "episodes": len(np.unique(episodes)),
        "target": statistics(position_errors(said, truth, TARGET), episodes, seed),
        "mid": statistics(position_errors(said, truth, MID), episodes, seed),
        "target_heading": statistics(turned[:, TARGET], episodes, seed),
        "mid_heading": statistics(turned[:, MID], episodes, seed),
        "contacts_agreed": _agreement(windows, predicted, rows, step),
    }


def _agreement(windows: Windows, predicted: ndarray, rows: Mask, step: int) -> float:
    """Return in which share of windows the last push moved the target in both or in neither."""
    agree = []
    for scenes in (predicted, windows.next_scenes):
        before = windows.scenes if step == 1 else scenes[:, step - 2]
        agree.append(target_moved(before[rows], scenes[rows, step - 1]))
    return float((agree[0] == agree[1]).mean())


def ratios(
    windows: Windows, predictions: Predictions, step: int, below: str, seed: int
) -> dict[str, list[float]]:
    """Return each mean target error over another one's, with its 95 % interval over episodes.

    Both over the windows of which both say something.
    """
    truth = windows.next_scenes[:, step - 1]
    errors = {
        name: position_errors(predicted[:, step - 1], truth, TARGET)
        for name, predicted in predictions.items()
    }
    found = {}
    for name, values in errors.items():
        rows = windows.known[:, step - 1] & np.isfinite(values) & np.isfinite(errors[below])
        if rows.any() and name != below:
            both = values[rows], errors[below][rows]
            found[name] = ratio_over_episodes(*both, windows.episodes[rows], seed)
    return found


def mean_target_errors(
    windows: Windows, predictions: Predictions, steps: Iterable[int]
) -> dict[str, Any]:
    """Return for each number of pushes how many windows there are, and mean errors [mm]."""
    found: dict[str, Any] = {}
    for step in steps:
        rows = windows.known[:, step - 1] if step <= windows.steps else np.zeros(0, dtype=bool)
        if rows.any():
            truth = windows.next_scenes[rows, step - 1]
            means = {
                name: float(position_errors(predicted[rows, step - 1], truth, TARGET).mean())
                for name, predicted in predictions.items()
            }
            found[str(step)] = {"windows": int(rows.sum()), "target_mean": means}
    return found
