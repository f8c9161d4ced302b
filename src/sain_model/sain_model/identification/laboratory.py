"""Fits one kind of physics to the recordings of a laboratory, by Gauss-Newton.

All episodes share the parameters but the friction with the table, of which each has its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.dataset import Transitions
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_model.identification.curves import curves_of, filter_of
from sain_model.identification.evidence import FACTORS, log_density, scales_of
from sain_model.identification.fitting import errors_at, normal_terms, slopes_of
from sain_model.identification.parameters import FRICTION, Places
from sain_model.identification.structures import Structure

STEPS: Final = 12
HALVINGS: Final = 5  # of a step that makes things worse
LONGEST: Final = 1.0  # [spreads], of a step
LEAST_FACTOR: Final = 1.0  # of the noise: many pushes fitted closely are worth less than all fitted
ENOUGH: Final = 1e-3  # [spreads], a shorter step is the last


@dataclass(frozen=True, eq=False)
class RecordedPushes(Transitions):
    """Pushes of the same bodies, and which episode each belongs to, counted over all recordings."""

    episode: Int[ndarray, "M"]
    bodies: Bodies = PAPER_DISKS


def count_episodes(parts: Sequence[RecordedPushes]) -> int:
    """Return the number of episodes of all parts together."""
    return 1 + max(int(part.episode.max()) for part in parts)


def shifted(parts: Sequence[RecordedPushes], by: int) -> list[RecordedPushes]:
    """Return the same pushes with other numbers of episodes."""
    return [replace(part, episode=part.episode + by) for part in parts]


@dataclass(frozen=True, eq=False)
class LaboratoryFit:
    """The most likely parameters of a laboratory.

    Attributes:
        structure: the kind of physics that the vectors z are about.
        shared: z of all parameters; that of the friction is the mean over episodes.
        covariance: of `shared`, (D, D).
        frictions: z of the friction of each episode.
        factor: of the noise, see `evidence.FACTORS`.
        log_evidence: of these parameters, by Laplace's approximation.
    """

    structure: Structure
    shared: Float[ndarray, "D"]
    covariance: Float[ndarray, "D D"]
    frictions: Float[ndarray, "E"]
    factor: float
    log_evidence: float


@dataclass(frozen=True, eq=False)
class _Normal:
    """Sums of the normal equations over each of E episodes."""

    information: Float[ndarray, "E D D"]
    pull: Float[ndarray, "E D"]


def fit_laboratory(structure: Structure, parts: Sequence[RecordedPushes]) -> LaboratoryFit:
    """Return the parameters that explain the pushes of a laboratory best.

    `structure` states what is believed of them beforehand.
    """
    count = count_episodes(parts)
    believed = structure.precision
    shared, frictions = np.zeros(len(believed)), _first_frictions(structure, parts, count)
    score, factor = _score(structure, parts, believed, shared, frictions)
    for _ in range(STEPS):
        normal = _normal(structure, parts, shared, frictions, factor, count)
        step, each = _step(normal, believed, shared, frictions)
        for halving in range(HALVINGS):
            share = 0.5**halving
            tried = shared + share * step, frictions + share * each
            better, now = _score(structure, parts, believed, *tried)
            if better > score:
                break
        else:
            break
        (shared, frictions), score, factor = tried, better, now
        if share * np.abs(step).max() < ENOUGH:
            break
    normal = _normal(structure, parts, shared, frictions, factor, count)
    covariance, room = _covariance(normal, believed)
    shared[FRICTION] = frictions.mean()
    return LaboratoryFit(structure, shared, covariance, frictions, factor, score - 0.5 * room)


def _places(shared: Float[ndarray, "D"], frictions: Float[ndarray, "M"]) -> Places:
    places = np.tile(shared, (len(frictions), 1))
    places[:, FRICTION] = frictions
    return places


def _first_frictions(
    structure: Structure, parts: Sequence[RecordedPushes], count: int
) -> Float[ndarray, "E"]:
    """Return the friction of each episode with all other parameters as believed."""
    unit, masses = structure.parameters[FRICTION].spread, filter_of(structure, PAPER_DISKS)
    sums, pushes = np.zeros((count, masses.size)), np.zeros(count, np.int64)
    for part in parts:
        curves = curves_of(structure, part.bodies, part)
        np.add.at(sums, part.episode, curves.likelihood)
        np.add.at(pushes, part.episode, 1)
    told = masses.told(sums, pushes)
    return np.asarray(np.log(told.friction / structure.config.friction) / unit)


def _score(
    structure: Structure,
    parts: Sequence[RecordedPushes],
    believed: Float[ndarray, "D D"],
    shared: Float[ndarray, "D"],
    frictions: Float[ndarray, "E"],
) -> tuple[float, float]:
    """Return the logarithm of the posterior density, and the factor of the noise it is for."""
    total = np.zeros(len(FACTORS))
    for part in parts:
        errors = errors_at(structure, part.bodies, part, _places(shared, frictions[part.episode]))
        scale = scales_of(part, part.bodies)
        total += log_density(errors, scale).sum(axis=0)
    far = _without_friction(shared) @ believed @ _without_friction(shared)
    far += believed[FRICTION, FRICTION] * (frictions**2).sum()
    total[FACTORS < LEAST_FACTOR] = -np.inf
    return float(total.max() - 0.5 * far), float(FACTORS[total.argmax()])


def _without_friction(shared: Float[ndarray, "D"]) -> Float[ndarray, "D"]:
    return np.where(np.arange(len(shared)) == FRICTION, 0.0, shared)


def _normal(
    structure: Structure,
    parts: Sequence[RecordedPushes],
    shared: Float[ndarray, "D"],
    frictions: Float[ndarray, "E"],
    factor: float,
    count: int,
) -> _Normal:
    size = len(shared)
    information, pull = np.zeros((count, size, size)), np.zeros((count, size))
    for part in parts:
        scale = factor * scales_of(part, part.bodies)
        places = _places(shared, frictions[part.episode])
        terms = normal_terms(*slopes_of(structure, part.bodies, part, places), scale)
        np.add.at(information, part.episode, terms[0])
        np.add.at(pull, part.episode, terms[1])
    return _Normal(information, pull)


def _reduced(
    normal: _Normal, believed: Float[ndarray, "D D"]
) -> tuple[Float[ndarray, "E"], Float[ndarray, "E S"], Float[ndarray, "S S"]]:
    """Return the information about each friction, its ties to the rest, and that about the rest."""
    own = normal.information[:, FRICTION, FRICTION] + believed[FRICTION, FRICTION]
    ties = np.delete(normal.information[:, FRICTION], FRICTION, axis=1)
    rest = _others(normal.information.sum(axis=0) + believed)
    return own, ties, rest - (ties / own[:, None]).T @ ties


def _others(matrix: Float[ndarray, "D D"]) -> Float[ndarray, "S S"]:
    """Return a matrix of parameters without the friction."""
    return np.delete(np.delete(matrix, FRICTION, 0), FRICTION, 1)


def _step(
    normal: _Normal,
    believed: Float[ndarray, "D D"],
    shared: Float[ndarray, "D"],
    frictions: Float[ndarray, "E"],
) -> tuple[Float[ndarray, "D"], Float[ndarray, "E"]]:
    """Return the change of what is shared, and of each friction, none too long."""
    own, ties, rest = _reduced(normal, believed)
    pull_own = normal.pull[:, FRICTION] + believed[FRICTION, FRICTION] * frictions
    pull = normal.pull.sum(axis=0) + believed @ _without_friction(shared)
    pull = np.delete(pull, FRICTION) - ties.T @ (pull_own / own)
    change = -np.linalg.solve(rest, pull)
    change *= LONGEST / max(float(np.abs(change).max()), LONGEST)
    each = -(pull_own + ties @ change) / own
    return np.insert(change, FRICTION, 0.0), np.clip(each, -LONGEST, LONGEST)


def _covariance(
    normal: _Normal, believed: Float[ndarray, "D D"]
) -> tuple[Float[ndarray, "D D"], float]:
    """Return the covariance of what is shared, and the logarithm of how much pushes tighten it.

    Errors of one episode have causes in common, which are counted once: White's estimate over
    episodes is added.
    """
    own, ties, rest = _reduced(normal, believed)
    inverse = np.linalg.inv(rest)
    scores = np.delete(normal.pull, FRICTION, axis=1)
    scores = scores - ties * (normal.pull[:, FRICTION] / own)[:, None]
    covariance = np.zeros_like(believed)
    others = np.arange(len(believed)) != FRICTION
    covariance[np.ix_(others, others)] = inverse + inverse @ (scores.T @ scores) @ inverse
    room = np.linalg.slogdet(rest)[1] - np.linalg.slogdet(_others(believed))[1]
    return covariance, float(room + np.log(own / believed[FRICTION, FRICTION]).sum())
