"""Most likely parameters for what each of many rows knows: Gauss-Newton under Student's t."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dataset import Transitions
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scenes
from sain_model.identification.evidence import (
    FACTORS,
    SIZE,
    TAIL,
    Known,
    errors_of,
    log_density,
    over_factors,
    picked,
    scales_of,
)
from sain_model.identification.parameters import Places, named_values_at
from sain_model.identification.structures import Structure
from sain_model.physics.planar import PlanarPrior

STEPS: Final = 3
DIFFERENCE: Final = 0.2  # [spreads], of a finite difference
LONGEST: Final = 1.5  # [spreads], of a step


@dataclass(frozen=True, eq=False)
class EpisodeFits:
    """The most likely parameters of R rows.

    Attributes:
        places: vectors z.
        information: what pushes tell of them, without what was believed before.
        log_evidence: by Laplace's approximation.
    """

    places: Places
    information: Float[ndarray, "R D D"]
    log_evidence: Float[ndarray, "R"]


def fit(
    structure: Structure,
    bodies: Bodies,
    pushes: Transitions,
    known: Known,
    start: Places,
) -> EpisodeFits:
    """Return the most likely parameters of each row, about those of a structure.

    Args:
        structure: kind of physics, and what is believed of its parameters.
        bodies: of all scenes.
        pushes: M of them.
        known: which of them each row knows; every row knows one.
        start: first vectors z (R, D).
    """
    told = picked(pushes, known.push)
    scale = scales_of(told, bodies)  # (P, N)
    believed = structure.precision
    places, count = start.copy(), start.shape[1]
    information = np.zeros((len(start), count, count))
    for _ in range(STEPS):
        terms = normal_terms(*slopes_of(structure, bodies, told, places[known.row]), scale)
        information, pull = map(known.gather, terms)
        pull += places @ believed
        step = -np.linalg.solve(information + believed, pull[..., None])[..., 0]
        longest = np.maximum(np.abs(step).max(axis=1, keepdims=True), LONGEST)
        places = places + step * (LONGEST / longest)
    errors = errors_at(structure, bodies, told, places[known.row])
    density = known.gather(log_density(errors, scale))  # (R, K)
    log_evidence = over_factors(density + _laplace(structure, places, information))
    return EpisodeFits(places, information, log_evidence)


def errors_at(
    structure: Structure, bodies: Bodies, pushes: Transitions, places: Places
) -> Float[ndarray, "P N 3"]:
    """Return errors [m] of predictions, each with parameters z of its own (P, D)."""
    after = step_at(structure, bodies, pushes, places)
    return errors_of(after, pushes.next_state)


def step_at(structure: Structure, bodies: Bodies, pushes: Transitions, places: Places) -> Scenes:
    """Predict pushes (P), each with parameters z of its own (P, D)."""
    prior = PlanarPrior(structure.config, bodies)
    return prior.step(pushes.state, pushes.action, named_values_at(structure.config, places))


def slopes_of(
    structure: Structure, bodies: Bodies, pushes: Transitions, places: Places
) -> tuple[Float[ndarray, "P N 3"], Float[ndarray, "P N 3 D"]]:
    """Return errors, and how they change with each parameter, from one batch of predictions."""
    count = places.shape[1]
    moved = np.concatenate([np.zeros((1, count)), DIFFERENCE * np.eye(count)])
    many = np.repeat(places, count + 1, axis=0) + np.tile(moved, (len(places), 1))
    again = picked(pushes, np.repeat(np.arange(len(places)), count + 1))
    errors = errors_at(structure, bodies, again, many)
    errors = errors.reshape(len(places), count + 1, *errors.shape[1:])
    slopes = (errors[:, 1:] - errors[:, :1]) / DIFFERENCE
    return errors[:, 0], np.moveaxis(slopes, 1, -1)


def normal_terms(
    errors: Float[ndarray, "P N 3"], slopes: Float[ndarray, "P N 3 D"], scale: Float[ndarray, "P N"]
) -> tuple[Float[ndarray, "P D D"], Float[ndarray, "P D"]]:
    """Return what each push adds to the normal equations: information, and pull."""
    errors, slopes = errors / scale[..., None], slopes / scale[..., None, None]
    weight = (TAIL + SIZE) / (TAIL + (errors**2).sum(axis=-1))  # (P, N), of Student's t
    weighted = weight[..., None, None] * slopes
    information = np.einsum("pnid,pnie->pde", weighted, slopes)
    return information, np.einsum("pnid,pni->pd", weighted, errors)


def _laplace(
    structure: Structure, places: Places, information: Float[ndarray, "R D D"]
) -> Float[ndarray, "R K"]:
    """Return what is believed of parameters, and the room that pushes leave, by noise factor."""
    far = np.einsum("rd,de,re->r", places, structure.precision, places)
    tightened = structure.covariance @ information
    room = [
        np.linalg.slogdet(np.eye(places.shape[1]) + tightened / factor**2)[1] for factor in FACTORS
    ]
    return np.asarray(-0.5 * (far[:, None] + np.stack(room, axis=1)))
