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
from sain_model.identification.parameters import FRICTION, config_at
from sain_model.identification.posterior import Posterior, infer, step_rows
from sain_model.network.settings import ANY_SHAPE
from sain_model.physics.planar import PlanarPrior

if TYPE_CHECKING:
    from sain_model.dynamics.sain import SainDynamics


@dataclass(frozen=True, eq=False)
class Learned:
    """An episode's earlier pushes, and what a model makes of them."""

    model: "SainDynamics"  # before them
    history: PushHistory
    likelihood: Float[ndarray, "M F"] | None = None  # of each friction for each push, logarithm


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
        "learned": Learned(model, history),
    }


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
    if model.network.config.bodies == ANY_SHAPE:
        belief = replace(belief, network_log_odds=belief.any_shape_log_odds)
    likeliest = belief.likeliest
    return {
        "belief": belief,
        "prior": replace(model.prior, config=likeliest.config),
        "corrects": likeliest.corrected and belief.network_log_odds > 0.0,
    }


def predict_rows(model: "SainDynamics", pushes: Transitions, told: LearnedRows) -> Prediction:
    """Predict push i with what row i tells, and say how sure that is."""
    posterior = told.posterior
    physics_next = _step(model, pushes, posterior)
    mean = _corrected(model, pushes, physics_next, told.corrected)
    ends = []
    for way in (-1.0, 1.0):
        places = posterior.places.copy()
        places[:, FRICTION] += way * posterior.spreads[:, FRICTION]
        after = _step(model, pushes, replace(posterior, places=places))
        ends.append(_corrected(model, pushes, after, told.corrected)[..., POSITION])
    friction = np.linalg.norm(ends[1] - ends[0], axis=-1) / 2
    members = model.members_spread(pushes.state, pushes.action, physics_next)
    return model.with_regions(Prediction(mean, members, friction), pushes.state, pushes.action)


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
    physics_next = _step(model, told, posterior.of_rows(rows[known.row]))
    corrected = model.network_correct(told.state, told.action, physics_next)
    plain, better = (
        over_factors(known.gather(log_density(errors_of(some, told.next_state), scale)))
        for some in (physics_next, corrected)
    )
    return np.asarray(better - plain)


def _step(model: "SainDynamics", pushes: Transitions, posterior: Posterior) -> Scenes:
    assert model.belief is not None
    return step_rows(model.belief, model.bodies, pushes, posterior)


def _corrected(
    model: "SainDynamics", pushes: Transitions, physics_next: Scenes, rows: Bool[ndarray, "R"]
) -> Scenes:
    """Return predictions, those of some rows corrected by the network."""
    after = physics_next.copy()
    if rows.any():
        after[rows] = model.network_correct(
            pushes.state[rows], pushes.action[rows], physics_next[rows]
        )
    return after
