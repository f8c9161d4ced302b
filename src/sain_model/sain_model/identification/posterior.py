"""What earlier pushes of an episode tell of the physics: its kind and its parameters.

Of each kind of physics, friction is inferred on a grid with all other parameters as believed. About
the kind with the greater evidence, all parameters are inferred together. What has the greatest
evidence predicts.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.dataset import Transitions
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scalars, Scenes
from sain_model.identification.beliefs import Belief
from sain_model.identification.curves import Curves, filter_of
from sain_model.identification.evidence import Known, log_sum, over_factors, picked
from sain_model.identification.fitting import EpisodeFits, fit, step_at
from sain_model.identification.parameters import COUNT, FRICTION, Places, parameters_of
from sain_model.identification.structures import Structure


@dataclass(frozen=True, eq=False)
class Posterior:
    """What each of R rows tells.

    Attributes:
        structure: number of the most likely kind of physics.
        inferred: whether all parameters are inferred; else friction alone.
        places: the parameters' vectors z.
        spreads: standard deviations of z.
        friction: with the table.
        friction_log_std: standard deviation of its logarithm.
        log_evidence: of each kind with friction alone, and of all parameters inferred.
        pushes: how many pushes each row knows.
    """

    structure: Int[ndarray, "R"]
    inferred: Bool[ndarray, "R"]
    places: Places
    spreads: Places
    friction: Scalars
    friction_log_std: Scalars
    log_evidence: Float[ndarray, "R H"]
    pushes: Int[ndarray, "R"]

    def of_rows(self, rows: Int[ndarray, "C"]) -> Self:
        """Return some rows, any of them as often as its number is given."""
        return type(self)(**{name: values[rows] for name, values in vars(self).items()})

    def corrected(self, belief: Belief) -> Bool[ndarray, "R"]:
        """Return the rows whose physics is the one that a network was trained on."""
        trained = np.array([structure.corrected for structure in belief.structures])
        return trained[self.structure] & ~self.inferred


def infer(belief: Belief, bodies: Bodies | None, pushes: Transitions, known: Known) -> Posterior:
    """Return what each row tells.

    Args:
        belief: what is believed before any push.
        bodies: of all scenes; None: disks.
        pushes: M of them.
        known: which of them each row knows.
    """
    alone = [
        _friction_alone(structure, bodies, belief.curves.of(structure, bodies, pushes), known)
        for structure in belief.structures
    ]
    means, spreads, log_evidence = (
        np.stack([part[index] for part in alone], axis=1) for index in range(3)
    )  # (R, S)
    best, row = log_evidence.argmax(axis=1), np.arange(known.rows)
    start = np.zeros((known.rows, COUNT))
    start[:, FRICTION] = means[row, best]
    wide = np.tile(_usual_spreads(belief), (known.rows, 1))
    wide[:, FRICTION] = spreads[row, best]
    places, information = start.copy(), np.full(known.rows, -np.inf)
    inferred = np.zeros(known.rows, dtype=bool)
    for number, structure in enumerate(belief.structures):
        rows = np.flatnonzero((best == number) & (known.counts > 0))
        if not len(rows):
            continue
        found = fit(structure, bodies, pushes, known.of_rows(rows), start[rows])
        information[rows] = found.log_evidence + structure.log_odds
        better = information[rows] > log_evidence[rows, number]
        inferred[rows] = better
        places[rows[better]] = found.places[better]
        wide[rows[better]] = _spreads(structure, found)[better]
    return _posterior(
        belief, best, inferred, places, wide, np.column_stack([log_evidence, information]), known
    )


def step_rows(
    belief: Belief, bodies: Bodies | None, pushes: Transitions, posterior: Posterior
) -> Scenes:
    """Predict push i (M, N, 8) with the physics of row i."""
    predicted = np.empty_like(pushes.state)
    for number, structure in enumerate(belief.structures):
        rows = np.flatnonzero(posterior.structure == number)
        if len(rows):
            some = picked(pushes, rows)
            predicted[rows] = step_at(structure, bodies, some, posterior.places[rows])
    return predicted


def _friction_alone(
    structure: Structure, bodies: Bodies | None, curves: Curves, known: Known
) -> tuple[Scalars, Scalars, Scalars]:
    """Return mean and spread of the friction's z, and the logarithm of the evidence, (R,)."""
    friction = filter_of(structure, bodies)
    told = friction.told(known.total(curves.likelihood), known.counts)
    unit = parameters_of(structure.config)[FRICTION].spread
    prior = friction.start().log_weights
    prior = prior - log_sum(prior, 0)
    densities = log_sum(known.total(curves.density) + prior[:, None], 1)
    log_evidence = over_factors(densities) + structure.log_odds
    place = np.log(told.mean / structure.config.friction) / unit
    return place, told.spread / unit, log_evidence


def _usual_spreads(belief: Belief) -> Float[ndarray, "D"]:
    return np.sqrt(np.diag(belief.likeliest.covariance))


def _spreads(structure: Structure, found: EpisodeFits) -> Places:
    """Return standard deviations of parameters (R, D) after pushes."""
    after = np.linalg.inv(found.information + structure.precision)
    return np.sqrt(np.diagonal(after, axis1=1, axis2=2))


def _posterior(
    belief: Belief,
    best: Int[ndarray, "R"],
    inferred: Bool[ndarray, "R"],
    places: Places,
    spreads: Places,
    log_evidence: Float[ndarray, "R H"],
    known: Known,
) -> Posterior:
    """Return a posterior; the first structure's where a row knows nothing."""
    nominal = np.array([structure.config.friction for structure in belief.structures])[best]
    unit = parameters_of(belief.structures[0].config)[FRICTION].spread
    friction = nominal * np.exp(unit * places[:, FRICTION])
    log_std = unit * spreads[:, FRICTION]
    return Posterior(best, inferred, places, spreads, friction, log_std, log_evidence, known.counts)
