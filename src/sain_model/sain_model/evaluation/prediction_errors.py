"""How well dynamics predict single pushes: errors beside the floor, with intervals."""

from typing import Any

import numpy as np

from sain_core.model import Model
from sain_core.types import Scenes
from sain_model.data.dataset import Dataset, Split
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.sain import LEARNED as LEARNED_KIND
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.baselines import step_as_nominal
from sain_model.evaluation.coverage import measure_intervals
from sain_model.evaluation.history_errors import (
    errors_by_history,
    history_predictions,
    mean_target_errors,
    step_on_true_friction,
)
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
    shares_removed,
    target_moved,
)
from sain_model.evaluation.open_loop_errors import card_errors
from sain_model.evaluation.shape_errors import shape_errors
from sain_model.physics.planar import PlanarPrior


def evaluate(
    data: Dataset, sain: Model | None = None, learned: Model | None = None, seed: int = 0
) -> dict[str, Any]:
    """Return the errors of all there is to compare, over all pushes and where the target moved.

    No model was trained on this data. `sain` is the corrected prior, `learned` the network alone.
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
    # of the nominal prior's error above the floor, over the pushes that moved the target
    result["reducible_error_removed"] = shares_removed(mean_target_errors(data, predictions, moved))
    result["intervals"] = {
        name: measure_intervals(model, data, seed)
        for name, model in ((LEARNED, learned), (SAIN, sain))
        if isinstance(model, SainDynamics) and model.intervals is not None
    }
    return result


def predict_all(data: Dataset, sain: Model | None, learned: Model | None) -> dict[str, Scenes]:
    """Return what each predictor says (M, N, 8); NaN where it cannot say."""
    planar = PlanarPrior()
    predictions = {
        NO_MOTION: data.state,
        NOMINAL: step_as_nominal(planar, data.state, data.action),
        BULLET: data.physics_next,
        MEASURED: planar.step(data.state, data.action),
        TRUE: step_on_true_friction(planar, data),
    }
    if learned is not None:
        predictions[LEARNED] = learned.step(data.state, data.action)
    if sain is not None:
        predictions[SAIN] = sain.step(data.state, data.action)
    predictions.update(history_predictions(data, sain))
    predictions[FLOOR] = data.floor_next
    return predictions


def held_out_errors(split: Split | MixedSplit, sain: SainDynamics) -> dict[str, Any]:
    """Return what a card says: the errors on what was held out, or else on what chose the epoch.

    Where numbers of disks differ: those with the fewest disks, and all under "by_disks". For bodies
    of any shape see `shape_errors`.
    """
    told = "test" if len(split.test) else "validation"
    if any(not part.bodies.are_paper_disks for part in held_out_part(split).parts):
        return {**shape_errors(held_out_part(split), sain), "held_out": told}
    models = (None, sain) if sain.kind == LEARNED_KIND else (sain, None)
    errors = {
        part.disks: {**evaluate(part, *models), "open_loop": card_errors(part, sain)}
        for part in held_out_part(split).parts
    }
    result = dict(errors[min(errors)])
    result["held_out"] = told
    if len(errors) > 1:
        result["by_disks"] = {str(disks): part for disks, part in errors.items()}
    return result


def held_out_part(split: Split | MixedSplit) -> Dataset | MixedDataset:
    """Return what errors are measured on: the test part, or without one the validation part."""
    return split.test if len(split.test) else split.validation
