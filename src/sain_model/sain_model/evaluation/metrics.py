"""Errors of predictions of single pushes, with intervals over episodes."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.bootstrap import bootstrap_mean
from sain_core.dataset import MOVED
from sain_core.scene import MID, POSITION, TARGET, THETA, wrap_angle
from sain_core.seeding import generator
from sain_core.types import Mask, Scalars, Scenes
from sain_model.data.dataset import Dataset

NO_MOTION: Final = "no motion"
NOMINAL: Final = "planar, nominal"
FLOOR: Final = "floor"
BULLET: Final = "bullet, nominal"
MEASURED: Final = "planar, measured"
SAIN: Final = "SAIN"
TRUE: Final = "planar, true"
LEARNED: Final = "learned only"


def target_moved(before: Scenes, after: Scenes) -> Mask:
    """Tell in which scenes (M, N, 8) the target moved by more than the paper's threshold."""
    way = after[:, TARGET, POSITION] - before[:, TARGET, POSITION]
    return np.asarray(np.linalg.norm(way, axis=-1) > MOVED)


def measure(predicted: Scenes, data: Dataset, seed: int) -> dict[str, float]:
    """Return errors of predictions (M, N, 8): target and mid disk [mm], their headings [mrad]."""
    target = position_errors(predicted, data.next_state, TARGET)
    mid = position_errors(predicted, data.next_state, MID)
    headings = heading_errors(predicted, data.next_state)
    found = statistics(target, data.episode, seed)
    return {
        "pushes": len(data),
        **{f"target_{name}": value for name, value in found.items()},
        "mid_mean": float(mid.mean()),
        "mid_median": float(np.median(mid)),
        "mid_p95": float(np.quantile(mid, 0.95)),
        "target_heading_median": float(np.median(headings[:, TARGET])),
        "mid_heading_median": float(np.median(headings[:, MID])),
    }


def statistics(values: Scalars, episodes: Int[ndarray, "M"], seed: int) -> dict[str, float]:
    """Return mean with its 95 % interval over episodes, median and p95."""
    mean, low, high = bootstrap_mean(values, generator(seed, "bootstrap"), episodes)
    return {
        "mean": mean,
        "low": low,
        "high": high,
        "median": float(np.median(values)),
        "p95": float(np.quantile(values, 0.95)),
    }


def heading_errors(predicted: Scenes, actual: Scenes) -> Float[ndarray, "M N"]:
    """Return how far off each disk's predicted heading is [mrad]."""
    return np.asarray(1e3 * np.abs(wrap_angle(predicted[..., THETA] - actual[..., THETA])))


def position_errors(predicted: Scenes, actual: Scenes, disk: int) -> Scalars:
    """Return how far off a disk's predicted position is, (M,) [mm]."""
    missing = predicted[:, disk, POSITION] - actual[:, disk, POSITION]
    return np.asarray(1e3 * np.linalg.norm(missing, axis=-1))


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
