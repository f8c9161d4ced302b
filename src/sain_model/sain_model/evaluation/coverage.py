"""Whether a model knows how sure it is: how often its regions hold, and what its spread tells."""

from typing import Any, Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.bootstrap import bootstrap_mean
from sain_core.scene import MID, TARGET
from sain_core.seeding import generator
from sain_core.types import Mask, Scalars
from sain_model.data.dataset import Dataset
from sain_model.dynamics.intervals import Prediction
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.history_errors import ENOUGH, earlier_pushes, predict_with_history
from sain_model.evaluation.metrics import position_errors, target_moved

THIRDS: Final = ("lowest third", "middle third", "highest third")


def measure_intervals(sain: SainDynamics, data: Dataset, seed: int) -> dict[str, Any]:
    """Return how often the regions hold mid disk and target, over all pushes and parts of them.

    Parts are thirds by the spread and by the radius, pushes that moved the target, and those
    with few or many earlier pushes. Distances are in mm.

    Neither the model's weights nor its intervals were fitted to this data.
    """
    assert sain.intervals is not None
    prediction = predict_with_history(sain, data)
    report: dict[str, Any] = {
        "level": sain.intervals.level,
        "members": sain.network.config.members,
    }
    for name, disk in (("target", TARGET), ("mid", MID)):
        report[name] = _disk(prediction, data, disk, seed)
    return report


def _disk(prediction: Prediction, data: Dataset, disk: int, seed: int) -> dict[str, Any]:
    assert prediction.radius is not None
    off = position_errors(prediction.mean, data.next_state, disk)
    radius = 1e3 * prediction.radius[:, disk]
    spread = 1e3 * prediction.spread[:, disk]
    count = earlier_pushes(data)
    parts: dict[str, Mask] = {
        "all": np.ones(len(data), dtype=bool),
        "target moved": target_moved(data.state, data.next_state),
        "no earlier push": count == 0,
        f"{ENOUGH} earlier pushes and more": count >= ENOUGH,
    }
    parts |= {f"{name} by spread": rows for name, rows in _thirds(spread).items()}
    parts |= {f"{name} by radius": rows for name, rows in _thirds(radius).items()}
    return {
        "parts": {
            name: _part(off[rows], spread[rows], radius[rows], data.episode[rows], seed)
            for name, rows in parts.items()
            if rows.any()
        },
        "rank_correlation": {
            "members": _rank(prediction.members[:, disk], off),
            "friction": _rank(prediction.friction[:, disk], off),
            "spread": _rank(spread, off),
            "radius": _rank(radius, off),
        },
    }


def _part(
    off: Scalars, spread: Scalars, radius: Scalars, episodes: Int[ndarray, "M"], seed: int
) -> dict[str, float]:
    held = (off <= radius).astype(np.float64)
    share, low, high = bootstrap_mean(held, generator(seed, "bootstrap"), episodes)
    return {
        "pushes": len(held),
        "coverage": share,
        "coverage_low": low,
        "coverage_high": high,
        "error_mean": float(off.mean()),
        "spread_mean": float(spread.mean()),
        "radius_median": float(np.median(radius)),
        "radius_mean": float(radius.mean()),
    }


def _thirds(values: Scalars) -> dict[str, Mask]:
    """Return three masks (M,) of the pushes in the order of these values."""
    place = np.empty(len(values), dtype=np.int64)
    place[np.argsort(values, kind="stable")] = np.arange(len(values))
    return {name: 3 * place // len(values) == third for third, name in enumerate(THIRDS)}


def _rank(values: Float[ndarray, "M"], off: Scalars) -> float | None:
    """Return Spearman's rank correlation; None where the values do not differ."""
    if len(values) < 3 or np.ptp(values) == 0.0 or np.ptp(off) == 0.0:
        return None
    return float(np.corrcoef(_ranks(values), _ranks(off))[0, 1])


def _ranks(values: Float[ndarray, "M"]) -> Float[ndarray, "M"]:
    """Return the ranks of values, from 1; equal ones share the mean of theirs."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - 0.5 * (count - 1))[place]
