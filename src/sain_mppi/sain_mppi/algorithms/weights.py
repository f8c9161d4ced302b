"""Softmin weights over sampled costs: the heart of MPPI (Williams et al. 2017, eq. 34)."""

import numpy as np

from sain_core.errors import OutOfRangeError
from sain_core.types import Scalars


def softmin_weights(costs: Scalars, temperature: float) -> Scalars:
    """Return weights (K,) proportional to exp(-cost / temperature), which sum to 1.

    Args:
        costs: (K,), at least one finite; infinite ones get no weight.
        temperature: lambda, in the unit of the costs. As it goes to 0 the weights pick the
            cheapest sample; at exactly 0 they do, shared equally among ties.

    Raises:
        OutOfRangeError: no finite cost, or a negative temperature.
    """
    if temperature < 0:
        raise OutOfRangeError(f"temperature is {temperature}; it must not be negative")
    cheapest = costs.min(initial=np.inf)
    if not np.isfinite(cheapest):
        raise OutOfRangeError("no cost is finite; softmin weights need at least one that is")
    excess = costs - cheapest
    if temperature == 0.0:
        weights = (excess == 0.0).astype(np.float64)
    else:
        with np.errstate(over="ignore"):  # a tiny temperature sends far costs to exp(-inf) = 0
            weights = np.exp(-excess / temperature)
    return np.asarray(weights / weights.sum())


def cost_spread(costs: Scalars) -> float:
    """Return the gap between the median and the smallest finite cost, the scale of a round.

    A temperature relative to it means the same 30 cm from the goal and 1 cm from it.
    """
    finite = np.asarray(costs)[np.isfinite(costs)]
    return float(np.median(finite) - finite.min())


def effective_samples(weights: Scalars) -> float:
    """Return how many equally weighted samples the weights (K,) are worth (Kish 1965): 1 to K."""
    return float(1.0 / np.square(weights).sum())
