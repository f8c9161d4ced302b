"""The noise of a prior for the inference of friction, fitted to training data."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dataset import Column
from sain_core.dynamics import Dynamics
from sain_core.errors import DatasetError
from sain_model.data.dataset import Dataset
from sain_model.data.mixed import MixedDataset
from sain_model.data.shaped_physics import filter_for
from sain_model.physics.friction import EpisodeFriction, FrictionConfig, FrictionFilter, ways
from sain_model.physics.planar import PlanarPrior

NOISES: Final = (0.0001, 0.0002, 0.0003, 0.0005, 0.001, 0.002)  # [m]
SHARES: Final = (0.005, 0.01, 0.02, 0.03, 0.05, 0.1)


def make_filter(prior: Dynamics, train: Dataset | MixedDataset) -> FrictionFilter | None:
    """Return what infers friction for a prior, its noise fitted where the truth is known.

    None for a prior that knows no friction. Noise is fitted to the part with the most pushes.
    """
    if not isinstance(prior, PlanarPrior):
        return None
    parts = train.parts
    if all(part.bodies.are_paper_disks for part in parts):
        parts = (max(parts, key=len),)
    known = all(np.isfinite(part.friction).all() for part in parts)
    config = fit_noise(prior, *parts) if known else FrictionConfig()
    return prior.filter(config)


def fit_noise(
    prior: PlanarPrior, *parts: Dataset, config: FrictionConfig = FrictionConfig()
) -> FrictionConfig:
    """Return the settings under which an episode's earlier pushes best tell its friction.

    Best is the highest mean logarithm of the density of the true friction, as a normal of the
    belief's mean and spread, over all pushes with earlier ones: a belief has to be near, and to
    know how near.

    Raises:
        DatasetError: the true friction is not known, or no episode has two pushes.
    """
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
    best, highest = config, -np.inf
    for noise, share in product(NOISES, SHARES):
        candidate = replace(config, noise=noise, noise_share=share)
        friction = prior.filter(candidate)
        known = friction.earlier(friction.weigh(errors, moved), episodes, steps)
        score = _score(known, truth)
        if score > highest:
            best, highest = candidate, score
    return best


def _errors(
    friction: FrictionFilter, parts: Sequence[Dataset]
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
    return float((-0.5 * off**2 - np.log(spread)).mean())
