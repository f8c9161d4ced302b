"""What a model of the dynamics makes of an episode's earlier pushes, for one row or for many.

The physics comes from `sain_model.identification.posterior`. Where it is the kind that the network
was trained on, the errors of the pushes with and without the network's correction tell whether the
correction holds.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from sain_core.dataset import Transitions
from sain_core.errors import ConfigError
from sain_core.history import PushHistory
from sain_core.scene import POSITION
from sain_core.types import Scenes
from sain_model.dynamics.intervals import Prediction
from sain_model.identification.beliefs import Belief
from sain_model.identification.evidence import (
    Known,
    errors_of,
    log_density,
    over_factors,
    picked,
    scales_of,
)
from sain_model.identification.masses import MassFilter, mass_filter
from sain_model.identification.parameters import FRICTION, MASS_RATIO, config_at
from sain_model.identification.posterior import Posterior, infer, step_rows
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import with_mass_ratio

if TYPE_CHECKING:
    from sain_model.dynamics.sain import SainDynamics


@dataclass(frozen=True, eq=False)
class Learned:
    """An episode's earlier pushes, and what a model makes of them."""

    model: "SainDynamics"  # before them
    history: PushHistory
    likelihood: Float[ndarray, "M F"] | None = None  # of each friction for each push, logarithm
    masses: MassFilter | None = None  # likelihoods are of its pairs; None: of frictions alone


@dataclass(frozen=True, eq=False)
class LearnedRows:
    """What each of R rows tells a model with a belief."""

    posterior: Posterior
    corrected: Bool[ndarray, "R"]  # whether the network's correction counts


def learn(model: "SainDynamics", pushes: Transitions, known: Known) -> LearnedRows:
    """Return what rows tell, each of the pushes that it knows."""
    belief = model.belief
    assert belief is not None
    posterior = infer(belief, model.bodies, pushes, known)
    corrected = posterior.corrected(belief) & (belief.network_log_odds > -np.inf)
    rows = np.flatnonzero(corrected)
    odds = belief.network_log_odds + _correction_odds(
        model, pushes, known.of_rows(rows), posterior, rows
    )
    corrected[rows] = odds > 0.0
    return LearnedRows(posterior, corrected)


def after_pushes(model: "SainDynamics", history: PushHistory) -> dict[str, Any]:
    """Return the fields of a model with a belief as an episode's earlier pushes leave it."""
    told = learn(model, history, Known.everything(len(history)))
    posterior, belief = told.posterior, model.belief
    assert belief is not None and isinstance(model.prior, PlanarPrior)
    structure = belief.structures[posterior.structure[0]]
    config = config_at(structure.config, posterior.places[0])
    return {
        "prior": replace(model.prior, config=config),
        "corrects": bool(told.corrected[0]),
        "conditioned_log_std": float(posterior.friction_log_std[0]),
        "mass_log_std": float(posterior.mass_log_std[0]),
        "learned": Learned(model, history),
    }


def after_noisy_pushes(model: "SainDynamics", history: PushHistory) -> dict[str, Any]:
    """Return the fields of a model with unknown masses as pushes seen with noise leave it.

    They tell friction and the ratio of masses, on the model's own prior.
    """
    assert model.belief is not None and model.friction is not None
    assert isinstance(model.prior, PlanarPrior)
    masses = mass_filter(model.prior, model.friction, model.belief.mass_log_std)
    likelihood = masses.likelihoods(history)
    told = masses.told(likelihood.sum(axis=0, keepdims=True), np.array([len(history)]))
    config = replace(
        model.prior.config,
        friction=float(told.friction[0]),
        mass_ratio=model.prior.config.mass_ratio * float(told.mass_ratio[0]),
    )
    return {
        "prior": replace(model.prior, config=config),
        "conditioned_log_std": float(told.friction_log_std[0]),
        "mass_log_std": float(told.mass_log_std[0]),
        "learned": Learned(model, history, likelihood, masses),
    }


def predict_past(told: Learned) -> Prediction:
    """Predict each push of a history from those before it, and say how sure that is."""
    model, past, likelihood = told.model, told.history, told.likelihood
    order = np.zeros(len(past), np.int64), np.arange(len(past))
    if likelihood is None:
        return predict_rows(model, past, learn(model, past, Known.earlier(*order)))
    if told.masses is None:
        assert model.filter is not None
        known = model.filter.earlier(likelihood, *order)
        return model.predict(past.state, past.action, known.mean, known.spread)
    earlier = Known.earlier(*order)
    found = told.masses.told(earlier.total(likelihood), earlier.counts)
    scenes = with_mass_ratio(past.state, found.mass_ratio)
    spreads = found.friction_log_std, found.mass_log_std
    return model.predict(scenes, past.action, found.friction, *spreads)


def before_pushes(model: "SainDynamics", belief: Belief) -> dict[str, Any]:
    """Return the fields of a model with this belief, at its most likely physics.

    Raises:
        ConfigError: it is for another prior.
    """
    assert isinstance(model.prior, PlanarPrior)
    has_axes = model.prior.config.has_axes
    if not any(s.corrected and s.config.has_axes == has_axes for s in belief.structures):
        raise ConfigError(
            f"the belief is for a network on another prior than {model.prior_name!r}; identify"
            " with this model"
        )
    likeliest = belief.likeliest
    return {
        "belief": belief,
        "prior": replace(model.prior, config=likeliest.config),
        "corrects": likeliest.corrected and belief.network_log_odds > 0.0,
        "mass_log_std": belief.mass_log_std,
    }


def predict_rows(model: "SainDynamics", pushes: Transitions, told: LearnedRows) -> Prediction:
    """Predict push i with what row i tells, and say how sure that is."""
    posterior = told.posterior
    physics_next = _step(model, pushes, posterior)
    mean = _corrected(model, pushes, physics_next, told)
    physics = _spread(model, pushes, told, FRICTION)
    if posterior.mass_log_std.any():
        physics = np.hypot(physics, _spread(model, pushes, told, MASS_RATIO))
    weighed = _weighed(model, pushes.state, posterior)
    members = model.members_spread(weighed, pushes.action, physics_next)
    return model.with_regions(Prediction(mean, members, physics), pushes.state, pushes.action)


def _spread(
    model: "SainDynamics", pushes: Transitions, told: LearnedRows, column: int
) -> Float[ndarray, "M N"]:
    """Return how far places move with the standard deviation of one parameter [m]."""
    ends = []
    for way in (-1.0, 1.0):
        places = told.posterior.places.copy()
        places[:, column] += way * told.posterior.spreads[:, column]
        moved = replace(told, posterior=replace(told.posterior, places=places))
        after = _step(model, pushes, moved.posterior)
        ends.append(_corrected(model, pushes, after, moved)[..., POSITION])
    return np.asarray(np.linalg.norm(ends[1] - ends[0], axis=-1) / 2)


def _correction_odds(
    model: "SainDynamics",
    pushes: Transitions,
    known: Known,
    posterior: Posterior,
    rows: ndarray,
) -> Float[ndarray, "R"]:
    """Return by how much the network explains pushes better, as a logarithm."""
    if not len(known.push):
        return np.zeros(len(rows))
    told = picked(pushes, known.push)
    scale = scales_of(told, model.bodies)
    believed = posterior.of_rows(rows[known.row])
    physics_next = _step(model, told, believed)
    weighed = _weighed(model, told.state, believed)
    corrected = model.network_correct(weighed, told.action, physics_next)
    plain, better = (
        over_factors(known.gather(log_density(errors_of(some, told.next_state), scale)))
        for some in (physics_next, corrected)
    )
    return np.asarray(better - plain)


def _step(model: "SainDynamics", pushes: Transitions, posterior: Posterior) -> Scenes:
    assert model.belief is not None
    return step_rows(model.belief, model.bodies, pushes, posterior)


def _corrected(
    model: "SainDynamics", pushes: Transitions, physics_next: Scenes, told: LearnedRows
) -> Scenes:
    """Return predictions, those of some rows corrected by the network."""
    after, rows = physics_next.copy(), told.corrected
    if rows.any():
        weighed = _weighed(model, pushes.state, told.posterior)[rows]
        after[rows] = model.network_correct(weighed, pushes.action[rows], physics_next[rows])
    return after


def _weighed(model: "SainDynamics", scenes: Scenes, posterior: Posterior) -> Scenes:
    """Return scenes (R, N, 8) for a model's network, which applies the ratio of its own prior."""
    assert model.belief is not None and isinstance(model.prior, PlanarPrior)
    ratios = np.array([structure.config.mass_ratio for structure in model.belief.structures])
    found = ratios[posterior.structure] * posterior.mass_ratio
    return with_mass_ratio(scenes, found / model.prior.config.mass_ratio)
