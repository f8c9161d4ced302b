"""How sure a rate is."""

import numpy as np
from scipy.special import ndtri  # scipy.stats would take half a second more to load

from sain_core.bootstrap import Interval
from sain_core.errors import OutOfRangeError


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
