"""Whether a page and a new sample agree: two-sample tests, corrected for their number."""

from collections.abc import Sequence
from math import isfinite, sqrt
from statistics import median
from typing import Final, NamedTuple

from benchmarks.verify.pages import Claim

LEVEL: Final = 0.05  # probability that one or more of all figures is outside by chance
FEWEST: Final = 3  # values of a mean
WIDTH: Final = 2 * 1.96  # standard errors of a 95 % interval
PRIOR: Final = 4  # degrees of freedom of the usual spread


class Measured(NamedTuple):
    """A figure on a new sample."""

    value: float
    n: int  # independent values: scenes, groups of pushes
    low: float  # of the 95 % interval
    high: float


class Judged(NamedTuple):
    """A claim beside its new measurement."""

    claim: Claim
    measured: Measured
    probability: float  # of a difference as large, if both are of one distribution; NaN: too few
    inside: bool


def probability(claim: Claim, new: Measured, usual: float = 0.0) -> float:
    """Return the two-sided probability of a difference as large by chance; NaN: cannot be judged.

    Shares are compared by Fisher's exact test. Means are compared by the difference over its
    standard error with Student's distribution; where the page states no interval, its spread is
    taken to be that of the new sample. Few values may lie close to each other by chance. So
    variances are moderated by the `usual` spread of such figures, over their mean (Smyth 2004,
    https://doi.org/10.2202/1544-6115.1027); 0: it is not known.
    """
    from scipy.stats import fisher_exact, t

    if claim.what == "solved":
        counts = [
            [round(one.value * one.n), round((1 - one.value) * one.n)] for one in (claim, new)
        ]
        return float(fisher_exact(counts).pvalue)
    if not _is_mean(new):
        return float("nan")
    own, freedom = _error(new), new.n - 1
    if usual and claim.bounds is None:
        expected = usual * max(abs(new.value), abs(claim.value)) / sqrt(new.n)
        total = freedom + PRIOR
        own, freedom = sqrt((freedom * own**2 + PRIOR * expected**2) / total), total
    if claim.bounds is not None:
        theirs = (claim.bounds[1] - claim.bounds[0]) / WIDTH
    else:
        theirs = own * sqrt(new.n / max(claim.n, 1))
    error = sqrt(own**2 + theirs**2)
    off = max(abs(new.value - claim.value) - claim.digit, 0.0)
    if not error:  # all values are equal, as of a few scenes that each took three pushes
        return float("nan") if off else 1.0
    return float(2.0 * t.sf(off / error, freedom))


def _is_mean(new: Measured) -> bool:
    """Return whether there are values enough to judge their mean."""
    return new.n >= FEWEST and isfinite(new.high - new.low)


def _error(new: Measured) -> float:
    """Return the standard error of a mean."""
    return (new.high - new.low) / WIDTH * sqrt(new.n / (new.n - 1))


def _spreads(pairs: Sequence[tuple[Claim, Measured]]) -> dict[str, float]:
    """Return the median spread of values over their mean, by what they are."""
    found: dict[str, list[float]] = {}
    for claim, new in pairs:
        if claim.what != "solved" and _is_mean(new) and new.value:
            one = _error(new) * sqrt(new.n) / abs(new.value)
            found.setdefault(claim.what, []).append(one)
    return {what: median(some) for what, some in found.items()}


def judge(pairs: Sequence[tuple[Claim, Measured]], level: float = LEVEL) -> list[Judged]:
    """Return all figures, judged by Holm's method (1979): together they err by `level` at most."""
    usual = _spreads(pairs)
    chances = [probability(one, new, usual.get(one.what, 0.0)) for one, new in pairs]
    judged = sorted((chance, place) for place, chance in enumerate(chances) if isfinite(chance))
    outside = set[int]()
    for rank, (chance, place) in enumerate(judged):
        if chance > level / (len(judged) - rank):
            break
        outside.add(place)
    return [
        Judged(*pair, chance, place not in outside)
        for place, (pair, chance) in enumerate(zip(pairs, chances, strict=True))
    ]
