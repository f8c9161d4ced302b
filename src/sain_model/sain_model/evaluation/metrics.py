"""Errors of predictions of single pushes, with intervals over episodes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.dataset import MOVED
from sain_core.scene import MID, POSITION, TARGET, THETA, wrap_angle
from sain_core.seeding import generator
from sain_core.types import Mask, Scalars, Scenes
from sain_model.data.dataset import Dataset

RESAMPLES: Final = 2000

NO_MOTION: Final = "no motion"
NOMINAL: Final = "planar, nominal"
FLOOR: Final = "floor"
BULLET: Final = "bullet, nominal"
MEASURED: Final = "planar, measured"
SAIN: Final = "SAIN"
TRUE: Final = "planar, true"
LEARNED: Final = "learned only"


@dataclass(frozen=True)
class Errors:
    """Errors of one predictor over some pushes.

    Attributes:
        pushes: how many.
        target_mean: of the target's position [mm].
        target_low: 95 % bootstrap interval of the mean over episodes [mm].
        target_high: likewise.
        target_median: [mm].
        target_p95: [mm].
        mid_mean: of the mid disk's position [mm].
        mid_median: [mm].
        mid_p95: [mm].
        target_heading_median: [mrad].
        mid_heading_median: [mrad].
    """

    pushes: int
    target_mean: float
    target_low: float
    target_high: float
    target_median: float
    target_p95: float
    mid_mean: float
    mid_median: float
    mid_p95: float
    target_heading_median: float
    mid_heading_median: float


def target_moved(before: Scenes, after: Scenes) -> Mask:
    """Tell in which scenes (M, N, 8) the target moved by more than the paper's threshold."""
    way = after[:, TARGET, POSITION] - before[:, TARGET, POSITION]
    return np.asarray(np.linalg.norm(way, axis=-1) > MOVED)


def measure(predicted: Scenes, data: Dataset, seed: int) -> Errors:
    """Return the errors of predictions (M, N, 8)."""
    target = position_errors(predicted, data.next_state, TARGET)
    mid = position_errors(predicted, data.next_state, MID)
    turned = 1e3 * np.abs(wrap_angle(predicted[..., THETA] - data.next_state[..., THETA]))
    low, high = bootstrap_over_episodes(target, data.episode, seed)
    return Errors(
        pushes=len(data),
        target_mean=float(target.mean()),
        target_low=low,
        target_high=high,
        target_median=float(np.median(target)),
        target_p95=float(np.quantile(target, 0.95)),
        mid_mean=float(mid.mean()),
        mid_median=float(np.median(mid)),
        mid_p95=float(np.quantile(mid, 0.95)),
        target_heading_median=float(np.median(turned[:, TARGET])),
        mid_heading_median=float(np.median(turned[:, MID])),
    )


def position_errors(predicted: Scenes, actual: Scenes, disk: int) -> Scalars:
    """Return how far off a disk's predicted position is, (M,) [mm]."""
    missing = predicted[:, disk, POSITION] - actual[:, disk, POSITION]
    return np.asarray(1e3 * np.linalg.norm(missing, axis=-1))


def bootstrap_over_episodes(
    values: Scalars, episodes: Int[ndarray, "M"], seed: int
) -> tuple[float, float]:
    """Return the 95 % interval of the mean when whole episodes are drawn again."""
    _, place = np.unique(episodes, return_inverse=True)
    sums, counts = np.bincount(place, values), np.bincount(place)
    drawn = generator(seed, "bootstrap").integers(len(sums), size=(RESAMPLES, len(sums)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def ratio_over_episodes(
    above: Scalars, below: Scalars, episodes: Int[ndarray, "M"], seed: int
) -> list[float]:
    """Return the ratio of two means and its 95 % interval when whole episodes are drawn again."""
    _, place = np.unique(episodes, return_inverse=True)
    first, second = np.bincount(place, above), np.bincount(place, below)
    drawn = generator(seed, "ratio").integers(len(first), size=(RESAMPLES, len(first)))
    ratios = first[drawn].sum(axis=1) / second[drawn].sum(axis=1)
    low, high = np.quantile(ratios, [0.025, 0.975])
    return [float(above.sum() / below.sum()), float(low), float(high)]


def shares_removed(means: Mapping[str, float]) -> dict[str, float]:
    """Return which share of the reducible error each predictor with a known mean removes.

    Reducible is what the nominal world errs by above the floor; nothing where either is not known.
    """
    reducible = means.get(BULLET, np.nan) - means.get(FLOOR, np.nan)
    if not reducible > 0.0:
        return {}
    return {
        name: float((means[BULLET] - mean) / reducible)
        for name, mean in means.items()
        if name not in (BULLET, FLOOR) and np.isfinite(mean)
    }
