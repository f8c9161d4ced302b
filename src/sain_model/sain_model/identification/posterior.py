"""What earlier pushes of an episode tell of the physics: its kind and its parameters.

Of each kind of physics, friction is inferred on a grid with all other parameters as believed, and
the ratio of masses with it where these are not measured. About the kind with the greater evidence,
all parameters are inferred together. What has the greatest evidence predicts.
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
from sain_model.identification.parameters import FRICTION, MASS_RATIO, RATIO, Places, mass_factor
from sain_model.identification.structures import Structure


@dataclass(frozen=True, eq=False)
class Posterior:
    """What each of R rows tells.

    Attributes:
        structure: number of the most likely kind of physics.
        inferred: whether all parameters are inferred; else friction and masses alone.
        places: the parameters' vectors z.
        spreads: standard deviations of z.
        friction: with the table.
        friction_log_std: standard deviation of its logarithm.
        log_evidence: of each kind with friction and masses alone, and of all parameters inferred.
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

    @property
    def mass_ratio(self) -> Scalars:
        """Masses of bodies 1 and on over that of body 0, times that believed before, (R,)."""
        return mass_factor(self.places)

    @property
    def mass_log_std(self) -> Scalars:
        """Standard deviation of its logarithm (R,); 0: masses are measured."""
        return np.asarray(RATIO.spread * self.spreads[:, MASS_RATIO:].sum(axis=1))

    def of_rows(self, rows: Int[ndarray, "C"]) -> Self:
        """Return some rows, any of them as often as its number is given."""
        return type(self)(**{name: values[rows] for name, values in vars(self).items()})

    def corrected(self, belief: Belief) -> Bool[ndarray, "R"]:
        """Return the rows whose physics is the one that a network was trained on."""
        trained = np.array([structure.corrected for structure in belief.structures])
        return trained[self.structure] & ~self.inferred


def infer(belief: Belief, bodies: Bodies, pushes: Transitions, known: Known) -> Posterior:
    """Return what each row tells.

    Args:
        belief: what is believed before any push.
        bodies: of all scenes.
        pushes: M of them.
        known: which of them each row knows.
    """
    usual = np.sqrt(np.diag(belief.likeliest.covariance))
    alone = [
        _on_grid(structure, bodies, belief.curves.of(structure, bodies, pushes), known, usual)
        for structure in belief.structures
    ]
    starts, spreads, log_evidence = (
        np.stack([part[index] for part in alone], axis=1) for index in range(3)
    )  # (R, S, D), (R, S, D), (R, S)
    best, row = log_evidence.argmax(axis=1), np.arange(known.rows)
    start, wide = starts[row, best], spreads[row, best]
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


def step_rows(belief: Belief, bodies: Bodies, pushes: Transitions, posterior: Posterior) -> Scenes:
    """Predict push i (M, N, 8) with the physics of row i."""
    predicted = np.empty_like(pushes.state)
    for number, structure in enumerate(belief.structures):
        rows = np.flatnonzero(posterior.structure == number)
        if len(rows):
            some = picked(pushes, rows)
            predicted[rows] = step_at(structure, bodies, some, posterior.places[rows])
    return predicted


def _on_grid(
    structure: Structure,
    bodies: Bodies,
    curves: Curves,
    known: Known,
    usual: Float[ndarray, "D"],
) -> tuple[Places, Places, Scalars]:
    """Return means and spreads of z (R, D), and the logarithm of the evidence (R,).

    Parameters other than friction and masses stay as believed, with their usual spreads.
    """
    masses = filter_of(structure, bodies)
    told = masses.told(known.total(curves.likelihood), known.counts)
    densities = log_sum(known.total(curves.density) + masses.log_prior[:, None], 1)
    log_evidence = over_factors(densities) + structure.log_odds
    places, spreads = np.zeros((known.rows, len(usual))), np.tile(usual, (known.rows, 1))
    unit = structure.parameters[FRICTION].spread
    places[:, FRICTION] = np.log(told.friction / structure.config.friction) / unit
    spreads[:, FRICTION] = told.friction_log_std / unit
    if structure.mass_log_std:
        places[:, MASS_RATIO] = np.log(told.mass_ratio) / RATIO.spread
        spreads[:, MASS_RATIO] = told.mass_log_std / RATIO.spread
    return places, spreads, log_evidence


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
    unit = belief.structures[0].parameters[FRICTION].spread
    friction = nominal * np.exp(unit * places[:, FRICTION])
    log_std = unit * spreads[:, FRICTION]
    return Posterior(best, inferred, places, spreads, friction, log_std, log_evidence, known.counts)
