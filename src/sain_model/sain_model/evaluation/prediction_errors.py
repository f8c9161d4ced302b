"""How well dynamics predict single pushes: errors beside the floor, with intervals."""

from typing import Any

import numpy as np

from sain_core.dynamics import Dynamics
from sain_core.scene import TARGET
from sain_core.types import Scenes
from sain_model.data.dataset import Dataset
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.coverage import measure_intervals
from sain_model.evaluation.history_errors import errors_by_history, history_predictions
from sain_model.evaluation.metrics import (
    BULLET,
    FLOOR,
    LEARNED,
    MEASURED,
    NO_MOTION,
    NOMINAL,
    SAIN,
    TRUE,
    measure,
    position_errors,
    shares_removed,
    target_moved,
)
from sain_model.physics.planar import PlanarPrior


def evaluate(
    data: Dataset, sain: Dynamics | None = None, learned: Dynamics | None = None, seed: int = 0
) -> dict[str, Any]:
    """Return the errors of all there is to compare, over all pushes and where the target moved.

    Args:
        data: pushes that no model was trained on.
        sain: the corrected prior, if there is one.
        learned: the network alone, if there is one.
        seed: for the bootstrap.
    """
    predictions = predict_all(data, sain, learned)
    moved = target_moved(data.state, data.next_state)
    result: dict[str, Any] = {
        "transitions": len(data),
        "episodes": len(np.unique(data.episode)),
        "moved": int(moved.sum()),
        "all": {},
        "target_moved": {},
    }
    for name, predicted in predictions.items():
        known = np.isfinite(predicted).all(axis=(1, 2))
        for part, rows in (("all", known), ("target_moved", known & moved)):
            if rows.any():
                result[part][name] = measure(predicted[rows], data.select(rows), seed)
    result["by_history"] = errors_by_history(data, predictions)
    result["reducible_error_removed"] = _shares(data, predictions)
    result["intervals"] = {
        name: measure_intervals(model, data, seed)
        for name, model in ((LEARNED, learned), (SAIN, sain))
        if isinstance(model, SainDynamics) and model.intervals is not None
    }
    return result


def predict_all(
    data: Dataset, sain: Dynamics | None, learned: Dynamics | None
) -> dict[str, Scenes]:
    """Return what each predictor says (M, N, 8); NaN where it cannot say."""
    planar = PlanarPrior()
    known = np.isfinite(data.friction)
    true = np.full_like(data.state, np.nan)
    true[known] = planar.step(data.state[known], data.action[known], data.friction[known])
    predictions = {
        NO_MOTION: data.state,
        NOMINAL: planar.step_as_nominal(data.state, data.action),
        BULLET: data.physics_next,
        MEASURED: planar.step(data.state, data.action),
        TRUE: true,
    }
    if learned is not None:
        predictions[LEARNED] = learned.step(data.state, data.action)
    if sain is not None:
        predictions[SAIN] = sain.step(data.state, data.action)
    predictions.update(history_predictions(data, sain))
    predictions[FLOOR] = data.floor_next
    return predictions


def _shares(data: Dataset, predictions: dict[str, Scenes]) -> dict[str, float]:
    """Return which share of the nominal prior's error above the floor each predictor removes.

    Over the pushes that moved the target; the floor is the mean of those that were repeated.
    """
    moved = target_moved(data.state, data.next_state)
    means = {}
    for name, predicted in predictions.items():
        rows = moved & (np.isfinite(predicted).all(axis=(1, 2)) if name == FLOOR else True)
        if not rows.any():
            return {}
        errors = position_errors(predicted[rows], data.next_state[rows], TARGET)
        means[name] = errors.mean()
    return shares_removed(means)
