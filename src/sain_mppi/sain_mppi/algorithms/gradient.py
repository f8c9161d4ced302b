"""Gradient descent through the whole model: slopes are differences, rolled out in batches."""

from functools import partial
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, PATH
from sain_core.types import PushSequences, Scalars
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.proposals import inside_limits

Paths = Float[ndarray, "S H 3"]  # location, angle and length of pushes

TINY: Final = 1e-12
NUDGE: Final = 0.02  # of the finite differences, in standard deviations of the noise
RATES: Final = np.geomspace(0.5, 0.004, 8)  # steps that are tried, in the same unit
FIRST, SECOND = 0.5, 0.99  # beta_1 and beta_2 of Adam


def gradient(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Sample, then go downhill from the best samples, all at once.

    Again from other samples when nothing was found that is better than doing nothing.
    """
    config, mean = search.config, start[0] if len(start) else None
    draw = partial(search.propose, mean, 0, generator)
    shares = config.gradient.drawn, config.gradient.descending
    count, descending = (max(round(share * config.samples), 1) for share in shares)
    for attempt in range(1 + config.stuck_rounds):
        if attempt and (search.over or search.improves):
            break
        sequences = search.draw_permitted(draw, count, generator)
        costs = search.evaluate(sequences)
        best = np.argsort(costs, kind="stable")[:descending]
        best = best[np.isfinite(costs[best])]
        descend(search, sequences[best], costs[best])


def descend(
    search: Search, sequences: PushSequences, costs: Scalars
) -> tuple[PushSequences, Scalars]:
    """Take steps in Adam's direction (Kingma and Ba 2015), each as long as is best for it.

    A number of a push counts in standard deviations of the noise. Rests stay rests: nothing
    depends on how they would push. Returns where the sequences end, and what that costs.
    """
    unit = search.config.noise.deviations(0)
    mean = square = np.zeros_like(sequences[..., PATH])
    for step in range(1, 1 + search.config.gradient.steps):
        if search.over:
            break
        slopes = unit * take_slopes(search, sequences, costs, NUDGE * unit)
        mean = FIRST * mean + (1.0 - FIRST) * slopes
        square = SECOND * square + (1.0 - SECOND) * slopes**2
        way = mean / (1.0 - FIRST**step) / (np.sqrt(square / (1.0 - SECOND**step)) + TINY)
        way *= sequences[..., LENGTH, None] > 0.0
        downhill = -unit * way / np.maximum(np.abs(way).max(axis=(1, 2), keepdims=True), TINY)
        sequences, costs = _step(search, sequences, costs, downhill)
    return sequences, costs


def take_slopes(
    search: Search, sequences: PushSequences, costs: Scalars, nudge: Float[ndarray, "3"]
) -> Paths:
    """Return how the cost of sequences (S, H, 5) rises with the numbers of every push's path.

    Differences are one-sided, towards the middle of what is allowed. The slope is 0 where the
    nudged sequence has no cost: its first push is not permitted, or the time was up.
    """
    limits, path = search.feasibility.limits, sequences[..., PATH]
    middle = np.array([0.0, 0.0, limits.max_length / 2])
    inwards = np.where(path > middle, -nudge, nudge)
    moving = np.broadcast_to(sequences[..., LENGTH, None] > 0.0, path.shape)
    owner, push, number = np.nonzero(moving)
    nudged = sequences[owner]
    nudged[np.arange(len(owner)), push, PATH.start + number] += inwards[moving]
    rise = search.probe(inside_limits(nudged, limits)) - costs[owner]
    slopes = np.zeros_like(path)
    slopes[moving] = np.where(np.isfinite(rise), rise / inwards[moving], 0.0)
    return slopes


def _step(
    search: Search, sequences: PushSequences, costs: Scalars, downhill: Paths
) -> tuple[PushSequences, Scalars]:
    """Return where the best of several rates leads each sequence; it stays where all are worse."""
    count, tries = len(sequences), len(RATES)
    tried = np.repeat(sequences[:, None], tries, axis=1)  # (S, R, H, 5)
    tried[..., PATH] += RATES[:, None, None] * downhill[:, None]
    tried = inside_limits(tried.reshape(-1, *sequences.shape[1:]), search.feasibility.limits)
    tried = search.without_idle(tried)
    after = search.probe(tried).reshape(count, tries)
    best = after.argmin(axis=1)
    lowest = after[np.arange(count), best]
    chosen = tried[tries * np.arange(count) + best]
    moved = np.where((lowest < costs)[:, None, None], chosen, sequences)
    return moved, np.minimum(lowest, costs)
