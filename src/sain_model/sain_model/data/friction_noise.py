"""The noise of a prior for the inference of friction, fitted to training data."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dataset import Column
from sain_core.errors import DatasetError
from sain_core.model import Model
from sain_model.data.dataset import Dataset, Part
from sain_model.data.shaped_physics import filter_for
from sain_model.physics.friction import EpisodeFriction, FrictionConfig, FrictionFilter, ways
from sain_model.physics.planar import PlanarPrior

NOISES: Final = (0.0001, 0.0002, 0.0003, 0.0005, 0.001, 0.002)  # [m]
SHARES: Final = (0.005, 0.01, 0.02, 0.03, 0.05, 0.1)


def make_filter(prior: Model, train: Dataset) -> FrictionFilter | None:
    """Return what infers friction for a prior, its noise fitted where the truth is known.

    None for a prior that knows no friction.
    """
    if not isinstance(prior, PlanarPrior):
        return None
    known = all(np.isfinite(part.friction).all() for part in train.parts)
    return prior.filter(fit_noise(prior, *train.parts) if known else FrictionConfig())


def fit_noise(
    prior: PlanarPrior, *parts: Part, config: FrictionConfig = FrictionConfig()
) -> FrictionConfig:
    """Return the settings under which an episode's earlier pushes best tell its friction.

    Best is the highest sum of the logarithm of the density of the true friction, as a normal of the
    belief's mean and spread, over all pushes with earlier ones: a belief has to be near, and to
    know how near.

    Raises:
        DatasetError: the true friction is not known, or no episode has two pushes.
    """
    kinds = {
        "noise": [part for part in parts if part.bodies.all_round],
        "outline_noise": [part for part in parts if not part.bodies.all_round],
    }
    present = {name: _scores(prior, some, config) for name, some in kinds.items() if some}
    share = int(np.argmax(sum(scores.max(axis=0) for scores in present.values())))
    best = {name: NOISES[int(scores[:, share].argmax())] for name, scores in present.items()}
    noise = best.get("noise", config.noise)
    outline_noise = best.get("outline_noise", config.outline_noise)
    return replace(config, noise=noise, outline_noise=outline_noise, noise_share=SHARES[share])


def _scores(
    prior: PlanarPrior, parts: Sequence[Part], config: FrictionConfig
) -> Float[ndarray, "A S"]:
    """Return the sum over pushes of the score of each noise and each share of the way."""
    truth, episodes, steps = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in (Column.FRICTION, Column.EPISODE, Column.STEP)
    )
    if not np.isfinite(truth).all():
        raise DatasetError("the data has no true friction to fit the noise of the inference to")
    if len(np.unique(episodes)) == len(episodes):
        raise DatasetError(
            f"none of {len(episodes)} episodes has two pushes: nothing to infer from"
        )
    errors, moved = _errors(prior.filter(config), parts)
    scores = []
    for noise, share in product(NOISES, SHARES):
        both = replace(config, noise=noise, outline_noise=noise, noise_share=share)
        friction = prior.filter(both)
        known = friction.earlier(friction.weigh(errors, moved), episodes, steps)
        scores.append(_score(known, truth))
    return np.reshape(scores, (len(NOISES), len(SHARES)))


def _errors(
    friction: FrictionFilter, parts: Sequence[Part]
) -> tuple[Float[ndarray, "M F W"], Float[ndarray, "M W"]]:
    """Return errors and ways of all parts; a body that a part lacks has no error."""
    errors, moved = [], []
    for part in parts:
        told = filter_for(friction, part.bodies)
        errors.append(told.errors(part.state, part.action, part.next_state))
        moved.append(ways(part.state, part.next_state))
    most = max(way.shape[1] for way in moved)
    errors, moved = (
        [np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, most - a.shape[-1])]) for a in arrays]
        for arrays in (errors, moved)
    )
    return np.concatenate(errors), np.concatenate(moved)


def _score(known: EpisodeFriction, truth: Float[ndarray, "M"]) -> float:
    rows = known.pushes > 0
    spread = np.hypot(known.spread[rows], 1e-3)
    off = np.log(known.mean[rows] / truth[rows]) / spread
    return float((-0.5 * off**2 - np.log(spread)).sum())
