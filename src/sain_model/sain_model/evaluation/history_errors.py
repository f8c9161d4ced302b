"""What an episode's earlier pushes are worth: errors with the friction that they tell of."""

from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dynamics import Dynamics
from sain_core.scene import TARGET
from sain_core.types import Mask, Scenes
from sain_model.data.dataset import Dataset
from sain_model.dynamics.intervals import Prediction
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.metrics import position_errors, shares_removed
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
    if data.bodies is not None:
        sain = sain.with_bodies(data.bodies)
    if sain.filter is None:
        return sain.predict(data.state, data.action)
    known = earlier_friction(sain.filter, data)
    return sain.predict(data.state, data.action, known.mean, known.spread)


def history_predictions(data: Dataset, sain: Dynamics | None) -> dict[str, Scenes]:
    """Return what predictors that know the earlier pushes say (M, N, 8), by their names."""
    planar = PlanarPrior()
    known = earlier_friction(planar.filter(), data)
    predictions = {PLANAR_HISTORY: planar.step(data.state, data.action, known.mean)}
    if not isinstance(sain, SainDynamics) or sain.filter is None:
        return predictions
    known = earlier_friction(sain.filter, data)
    assert isinstance(sain.prior, PlanarPrior)
    predictions[PRIOR_HISTORY] = sain.prior.step(data.state, data.action, known.mean)
    predictions[SAIN_HISTORY] = sain.step(data.state, data.action, known.mean)
    truth = np.isfinite(data.friction)
    told = np.full_like(data.state, np.nan)
    told[truth] = sain.step(data.state[truth], data.action[truth], data.friction[truth])
    predictions[SAIN_TRUE] = told
    return predictions


def errors_by_history(data: Dataset, predictions: dict[str, Scenes]) -> list[dict[str, Any]]:
    """Return mean target errors [mm] and shares removed, by the number of earlier pushes.

    A share is that of the reducible error, the nominal world's minus the floor's, that a
    predictor removes. The floor is the mean over those pushes of the group that were repeated.
    """
    count = earlier_pushes(data)
    groups = [(str(n), count == n) for n in range(ENOUGH)] + [(f"{ENOUGH}+", count >= ENOUGH)]
    return [
        {"earlier": name, "pushes": int(rows.sum()), **_group(data, predictions, rows)}
        for name, rows in groups
        if rows.any()
    ]


def earlier_pushes(data: Dataset) -> ndarray:
    """Return how many earlier pushes each push (M,) has in its own episode."""
    order = np.lexsort((data.step, data.episode))
    _, first, place = np.unique(data.episode[order], return_index=True, return_inverse=True)
    count = np.empty(len(data), dtype=np.int64)
    count[order] = np.arange(len(data)) - first[place]
    return count


def _group(data: Dataset, predictions: dict[str, Scenes], rows: Mask) -> dict[str, Any]:
    means = {
        name: _mean(position_errors(predicted[rows], data.next_state[rows], TARGET))
        for name, predicted in predictions.items()
    }
    means = {name: mean for name, mean in means.items() if np.isfinite(mean)}
    group: dict[str, Any] = {"target_mean": means}
    removed = shares_removed(means)
    return group | {"removed": removed} if removed else group


def _mean(errors: Float[ndarray, "M"]) -> float:
    known = errors[np.isfinite(errors)]
    return float(known.mean()) if len(known) else float("nan")
