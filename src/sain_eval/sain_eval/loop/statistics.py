"""How sure a rate or a mean is."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri  # scipy.stats would take half a second more to load

from sain_core.errors import OutOfRangeError
from sain_core.types import Scalars


@dataclass(frozen=True)
class Interval:
    """An estimate with the interval that should hold the truth."""

    estimate: float
    low: float
    high: float


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Return a success rate with its Wilson score interval (Wilson 1927, eq. 6 ff.).

    Unlike the normal one it is right for rates near 0 and 1 and for few trials.

    Raises:
        OutOfRangeError: not 0 <= successes <= trials, or no trial.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise OutOfRangeError(
            f"{successes} successes of {trials} trials;"
            " needed: 0 <= successes <= trials and at least one trial"
        )
    share, z = successes / trials, float(ndtri(0.5 + 0.5 * confidence))
    centre = (successes + z**2 / 2) / (trials + z**2)
    half = z * np.sqrt(trials * share * (1.0 - share) + z**2 / 4) / (trials + z**2)
    low = 0.0 if successes == 0 else float(centre - half)
    high = 1.0 if successes == trials else float(centre + half)
    return Interval(share, low, high)


def bootstrap_mean(
    values: Scalars,
    random: np.random.Generator,
    confidence: float = 0.95,
    resamples: int = 2000,
) -> Interval:
    """Return a mean with its percentile bootstrap interval; NaN all through for no values."""
    values = np.asarray(values, dtype=np.float64)
    if not len(values):
        return Interval(np.nan, np.nan, np.nan)
    draws = random.choice(values, (resamples, len(values))).mean(axis=1)
    low, high = np.quantile(draws, [0.5 - confidence / 2, 0.5 + confidence / 2])
    return Interval(float(values.mean()), float(low), float(high))
