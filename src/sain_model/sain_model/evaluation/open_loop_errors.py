"""Errors of rollouts after so many pushes: statistics, intervals over episodes, ratios."""

from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_core.bootstrap import bootstrap_ratio
from sain_core.model import Model
from sain_core.scene import MID, TARGET
from sain_core.seeding import generator
from sain_core.types import Mask
from sain_model.data.dataset import Dataset
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import STEPS
from sain_model.evaluation.history_errors import ENOUGH
from sain_model.evaluation.metrics import (
    LEARNED,
    MEASURED,
    heading_errors,
    position_errors,
    statistics,
    target_moved,
)
from sain_model.evaluation.open_loop import NAMES, OpenLoop, roll_out
from sain_model.physics.planar import PlanarPrior

PARTS: Final = ("all", "contact made", "contact missed", f"{ENOUGH} pushes before and more")


def errors_after(loop: OpenLoop, step: int, seed: int) -> dict[str, Any]:
    """Return the errors after so many pushes, from 1, over windows that are as long.

    ``contact made`` are windows whose pushes moved the target by more than 2 mm in all.
    """
    windows = loop.windows
    long_enough = windows.known[:, step - 1]
    moved = target_moved(windows.scenes, windows.next_scenes[:, step - 1])
    masks = (long_enough, moved, ~moved, loop.earlier >= ENOUGH)
    return {
        part: {
            name: row
            for name, predicted in loop.predictions.items()
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


def ratios(loop: OpenLoop, step: int, below: str, seed: int) -> dict[str, list[float]]:
    """Return each mean target error over another one's, with its 95 % interval over episodes.

    Both over the windows of which both say something.
    """
    windows, found = loop.windows, {}
    truth = windows.next_scenes[:, step - 1]
    errors = {
        name: position_errors(predicted[:, step - 1], truth, TARGET)
        for name, predicted in loop.predictions.items()
    }
    for name, values in errors.items():
        rows = windows.known[:, step - 1] & np.isfinite(values) & np.isfinite(errors[below])
        if rows.any() and name != below:
            both = values[rows], errors[below][rows]
            found[name] = bootstrap_ratio(*both, generator(seed, "ratio"), windows.episodes[rows])
    return found


def card_errors(data: Dataset, sain: SainDynamics) -> dict[str, Any]:
    """Return mean target errors [mm] of a model and of physics, cheaply, for a model's card."""
    windows = make_windows(data, max(STEPS))
    models: dict[str, Model] = {MEASURED: PlanarPrior(), NAMES.get(sain.kind, LEARNED): sain}
    predictions = {
        name: roll_out(model, windows.scenes, windows.pushes) for name, model in models.items()
    }
    found: dict[str, Any] = {}
    for step in STEPS:
        rows = windows.known[:, step - 1]
        if rows.any():
            truth = windows.next_scenes[rows, step - 1]
            means = {
                name: float(position_errors(predicted[rows, step - 1], truth, TARGET).mean())
                for name, predicted in predictions.items()
            }
            found[str(step)] = {"windows": int(rows.sum()), "target_mean": means}
    return found
