"""Randomness: generators from seeds and paths, and how certain a mean is.

``generator(7, "collect", 12)`` is the same stream on every machine and in every process,
and independent of ``generator(7, "collect", 13)``: work can be split over workers at will.
"""

import hashlib
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy import ndarray

from sain_core.types import Scalars


def generator(seed: int, *path: str | int) -> np.random.Generator:
    """Return the random generator that belongs to a seed and a path below it."""
    if seed < 0:
        raise ValueError(f"seed is {seed}; it must not be negative")
    words = [int.from_bytes(hashlib.sha256(str(part).encode()).digest()[:4]) for part in path]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *words])))


RESAMPLES: Final = 2000


class Interval(NamedTuple):
    """An estimate with the interval that should hold the truth."""

    estimate: float
    low: float
    high: float


def bootstrap_mean(
    values: Scalars, random: np.random.Generator, groups: Shaped[ndarray, "M"] | None = None
) -> Interval:
    """Return a mean with its 95 % interval; see `bootstrap_ratio`."""
    return bootstrap_ratio(values, np.ones(len(values)), random, groups)


def bootstrap_ratio(
    above: Scalars,
    below: Scalars,
    random: np.random.Generator,
    groups: Shaped[ndarray, "M"] | None = None,
) -> Interval:
    """Return the ratio of two means of M values with its 95 % interval; NaN for no values.

    Bounds are infinite or NaN where values `below` that may be drawn are all 0.

    Values of one group, as of one episode, are drawn together; None: each one alone.
    """
    if not len(above):
        return Interval(np.nan, np.nan, np.nan)
    first, second = np.asarray(above, np.float64), np.asarray(below, np.float64)
    if groups is not None:
        place = np.unique(groups, return_inverse=True)[1]
        first, second = (np.bincount(place, values).astype(float) for values in (first, second))
    drawn = random.integers(len(first), size=(RESAMPLES, len(first)))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = first[drawn].sum(axis=1) / second[drawn].sum(axis=1)
        low, high = np.quantile(ratios, [0.025, 0.975])
        return Interval(float(first.sum() / second.sum()), float(low), float(high))
