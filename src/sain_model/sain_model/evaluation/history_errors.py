"""What an episode's earlier pushes are worth: errors with the friction that they tell of."""

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_core.model import Model
from sain_core.scene import TARGET
from sain_core.types import Mask, Scalars, Scenes
from sain_model.data.dataset import Dataset
from sain_model.dynamics.intervals import Prediction, pushed_errors
from sain_model.dynamics.learning import learn, predict_rows
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.metrics import position_errors, shares_removed
from sain_model.identification.evidence import Known
from sain_model.physics.friction import EpisodeFriction, FrictionFilter
from sain_model.physics.planar import PlanarPrior

PRIOR_HISTORY: Final = "its prior, history"
SAIN_HISTORY: Final = "SAIN, history"
SAIN_TRUE: Final = "SAIN, true friction"
PLANAR_HISTORY: Final = "planar, history"
ENOUGH: Final = 3  # earlier pushes from which on they are taken together


def earlier_friction(friction: FrictionFilter, data: Dataset) -> EpisodeFriction:
    """Return for each push what the pushes before it in its own episode tell; inferred once."""
    if friction not in data.inferred:
        likelihood = friction.log_likelihood(data.state, data.action, data.next_state)
        data.inferred[friction] = friction.earlier(likelihood, data.episode, data.step)
    return data.inferred[friction]


def predict_with_history(sain: SainDynamics, data: Dataset) -> Prediction:
    """Return predictions as in deployment: with what the episode's earlier pushes tell."""
    if not data.bodies.are_paper_disks:
        sain = sain.with_bodies(data.bodies)
    if sain.filter is None:
        return sain.predict(data.state, data.action)
    if sain.belief is not None:
        rows = learn(sain, data, Known.earlier(data.episode, data.step))
        told = predict_rows(sain, data, rows)
    else:
        known = earlier_friction(sain.filter, data)
        told = sain.predict(data.state, data.action, known.mean, known.spread)
    if sain.intervals is None or not sain.intervals.adapts or told.radius is None:
        return told
    excess = sain.intervals.excess(*pushed_errors(told, data))
    widening = sain.intervals.widening(*_sums_before(data, excess))
    return replace(told, radius=told.radius * widening[:, None])


def _sums_before(data: Dataset, values: Scalars) -> tuple[Scalars, ndarray]:
    """Return sums over the earlier pushes of each push's episode (M,), and their numbers."""
    order = np.lexsort((data.step, data.episode))
    count = earlier_pushes(data)
    sums = np.concatenate([[0.0], np.cumsum(values[order])])
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    return sums[place] - sums[place - count], count


def history_predictions(data: Dataset, sain: Model | None) -> dict[str, Scenes]:
    """Return what predictors that know the earlier pushes say (M, N, 8), by their names."""
    planar = PlanarPrior()
    known = earlier_friction(planar.filter(), data)
    predictions = {PLANAR_HISTORY: planar.step(data.state, data.action, {"friction": known.mean})}
    if not isinstance(sain, SainDynamics) or sain.filter is None:
        return predictions
    known = earlier_friction(sain.filter, data)
    assert isinstance(sain.prior, PlanarPrior)
    predictions[PRIOR_HISTORY] = sain.prior.step(data.state, data.action, {"friction": known.mean})
    predictions[SAIN_HISTORY] = predict_with_history(sain, data).mean
    predictions[SAIN_TRUE] = step_on_true_friction(sain, data)
    return predictions


def step_on_true_friction(model: SainDynamics | PlanarPrior, data: Dataset) -> Scenes:
    """Return what a model says (M, N, 8) that is told the true friction; NaN: it is not known."""
    known = np.isfinite(data.friction)
    told = np.full_like(data.state, np.nan)
    values = {"friction": data.friction[known]}
    told[known] = model.step(data.state[known], data.action[known], values)
    return told


def errors_by_history(data: Dataset, predictions: dict[str, Scenes]) -> list[dict[str, Any]]:
    """Return mean target errors [mm] and shares removed, by the number of earlier pushes.

    A share is that of the reducible error, the nominal world's minus the floor's, that a
    predictor removes. The floor is the mean over those pushes of the group that were repeated.
    """
    count = earlier_pushes(data)
    groups = [(str(n), count == n) for n in range(ENOUGH)] + [(f"{ENOUGH}+", count >= ENOUGH)]
    found = []
    for name, rows in groups:
        if rows.any():
            means = mean_target_errors(data, predictions, rows)
            group = {"earlier": name, "pushes": int(rows.sum()), "target_mean": means}
            removed = shares_removed(means)
            found.append(group | {"removed": removed} if removed else group)
    return found


def earlier_pushes(data: Dataset) -> ndarray:
    """Return how many earlier pushes each push (M,) has in its own episode."""
    order = np.lexsort((data.step, data.episode))
    _, first, place = np.unique(data.episode[order], return_index=True, return_inverse=True)
    count = np.empty(len(data), dtype=np.int64)
    count[order] = np.arange(len(data)) - first[place]
    return count


def mean_target_errors(
    data: Dataset, predictions: dict[str, Scenes], rows: Mask
) -> dict[str, float]:
    """Return each predictor's mean target error [mm] over those of these pushes that it knows."""
    means = {}
    for name, predicted in predictions.items():
        errors = position_errors(predicted[rows], data.next_state[rows], TARGET)
        known = errors[np.isfinite(errors)]
        if len(known):
            means[name] = float(known.mean())
    return means
