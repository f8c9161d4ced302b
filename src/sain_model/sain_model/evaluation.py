"""How well dynamics predict single pushes: errors beside the floor, with intervals."""

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dynamics import Dynamics
from sain_core.scene import MID, POSITION, TARGET, THETA, wrap_angle
from sain_core.seeding import generator
from sain_core.types import Mask, Scalars, Scenes
from sain_model.dataset import Transitions
from sain_model.planar import PlanarPrior

MOVED: Final = 0.002  # [m], the paper's threshold for a target that moved (section III-B b)
RESAMPLES: Final = 2000

FLOOR: Final = "floor"
BULLET: Final = "bullet, nominal"
MEASURED: Final = "planar, measured"
SAIN: Final = "SAIN"
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


def evaluate(
    data: Transitions, sain: Dynamics | None = None, learned: Dynamics | None = None, seed: int = 0
) -> dict[str, Any]:
    """Return the errors of all there is to compare, over all pushes and where the target moved.

    Args:
        data: pushes that no model was trained on.
        sain: the corrected prior, if there is one.
        learned: the network alone, if there is one.
        seed: for the bootstrap.
    """
    predictions = predict_all(data, sain, learned)
    moved = target_moved(data)
    result: dict[str, Any] = {
        "transitions": len(data),
        "episodes": len(np.unique(data.episodes)),
        "moved": int(moved.sum()),
        "all": {},
        "target_moved": {},
    }
    for name, predicted in predictions.items():
        known = np.isfinite(predicted).all(axis=(1, 2))
        for part, rows in (("all", known), ("target_moved", known & moved)):
            if rows.any():
                errors = measure(predicted[rows], data.select(rows), seed)
                result[part][name] = asdict(errors)
    result["reducible_error_removed"] = _shares(data, predictions)
    return result


def predict_all(
    data: Transitions, sain: Dynamics | None, learned: Dynamics | None
) -> dict[str, Scenes]:
    """Return what each predictor says (M, N, 8); NaN where it cannot say."""
    planar = PlanarPrior()
    known = np.isfinite(data.friction)
    true = np.full_like(data.scenes, np.nan)
    true[known] = planar.step(data.scenes[known], data.pushes[known], data.friction[known])
    predictions = {
        "no motion": data.scenes,
        "planar, nominal": planar.step_as_nominal(data.scenes, data.pushes),
        BULLET: data.physics_next,
        MEASURED: planar.step(data.scenes, data.pushes),
        "planar, true": true,
    }
    if learned is not None:
        predictions[LEARNED] = learned.step(data.scenes, data.pushes)
    if sain is not None:
        predictions[SAIN] = sain.step(data.scenes, data.pushes)
    predictions[FLOOR] = data.floor_next
    return predictions


def target_moved(data: Transitions) -> Mask:
    """Tell which pushes (M,) moved the target by more than the paper's threshold."""
    way = data.next_scenes[:, TARGET, POSITION] - data.scenes[:, TARGET, POSITION]
    return np.asarray(np.linalg.norm(way, axis=-1) > MOVED)


def measure(predicted: Scenes, data: Transitions, seed: int) -> Errors:
    """Return the errors of predictions (M, N, 8)."""
    target = position_errors(predicted, data.next_scenes, TARGET)
    mid = position_errors(predicted, data.next_scenes, MID)
    turned = 1e3 * np.abs(wrap_angle(predicted[..., THETA] - data.next_scenes[..., THETA]))
    low, high = bootstrap_over_episodes(target, data.episodes, seed)
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
    values: Scalars, episodes: Float[ndarray, "M"] | ndarray, seed: int
) -> tuple[float, float]:
    """Return the 95 % interval of the mean when whole episodes are drawn again."""
    _, place = np.unique(episodes, return_inverse=True)
    sums, counts = np.bincount(place, values), np.bincount(place)
    drawn = generator(seed, "bootstrap").integers(len(sums), size=(RESAMPLES, len(sums)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def _shares(data: Transitions, predictions: dict[str, Scenes]) -> dict[str, float]:
    """Return which share of the nominal prior's error above the floor each predictor removes.

    Over the pushes that moved the target; the floor is the mean of those that were repeated.
    """
    moved = target_moved(data)
    means = {}
    for name, predicted in predictions.items():
        rows = moved & (np.isfinite(predicted).all(axis=(1, 2)) if name == FLOOR else True)
        if not rows.any():
            return {}
        errors = position_errors(predicted[rows], data.next_scenes[rows], TARGET)
        means[name] = errors.mean()
    reducible = means[BULLET] - means[FLOOR]
    if not reducible > 0.0:
        return {}
    return {
        name: float((means[BULLET] - mean) / reducible)
        for name, mean in means.items()
        if name not in (BULLET, FLOOR) and np.isfinite(mean)
    }
