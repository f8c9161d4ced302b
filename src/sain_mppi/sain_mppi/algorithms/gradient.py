"""Gradient descent through the whole model: slopes are differences, rolled out in batches."""

from functools import partial
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, PATH
from sain_core.types import PushSequences, Scalars
from sain_mppi.algorithms.config import GradientConfig
from sain_mppi.algorithms.proposals import draw_permitted, propose, without_idle
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.sampling import inside_limits

TINY: Final = 1e-12


def gradient(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Sample, then go downhill from the best samples, all at once.

    Again from other samples when nothing was found that is better than doing nothing.
    """
    config, mean = search.config, start[0] if len(start) else None
    draw = partial(propose, search, mean, 0, generator)
    shares = config.gradient.drawn, config.gradient.descending
    count, descending = (max(round(share * config.samples), 1) for share in shares)
    for attempt in range(1 + config.stuck_rounds):
        if attempt and (search.over or search.improves):
            break
        sequences = draw_permitted(search, draw, count, generator)
        costs = search.evaluate(sequences)
        best = np.argsort(costs, kind="stable")[:descending]
        best = best[np.isfinite(costs[best])]
        descend(search, sequences[best], costs[best])


def descend(
    search: Search, sequences: PushSequences, costs: Scalars
) -> tuple[PushSequences, Scalars]:
    """Take steps of Adam's direction, as long as the line search finds best for each sequence.

    A number of a push counts in standard deviations of the noise. Rests stay rests: nothing
    depends on how they would push. Returns where the sequences end, and what that costs.
    """
    settings, unit = search.config.gradient, search.config.noise.deviations(0)
    adam = Adam(settings)
    for _ in range(settings.steps):
        if search.over:
            break
        slopes = take_slopes(search, sequences, costs, settings.difference * unit)
        way = adam.direction(unit * slopes[..., PATH]) * (sequences[..., LENGTH, None] > 0.0)
        longest = np.abs(way).max(axis=(1, 2), keepdims=True)
        downhill = np.zeros_like(sequences)
        downhill[..., PATH] = -unit * way / np.maximum(longest, TINY)
        sequences, costs = _step(search, sequences, costs, downhill, settings.rates())
    return sequences, costs


def take_slopes(
    search: Search, sequences: PushSequences, costs: Scalars, nudge: Float[ndarray, "3"]
) -> PushSequences:
    """Return how the cost of sequences (S, H, 5) rises with the numbers of every push's path.

    Differences are one-sided, towards the middle of what is allowed. The slope is 0 where the
    nudged sequence has no cost: its first push is not permitted, or the time was up.
    """
    limits = search.feasibility.limits
    middle = np.array([0.0, 0.0, limits.max_length / 2])
    path = sequences[..., PATH]
    inwards = np.where(path > middle, -nudge, nudge)
    moving = np.broadcast_to(sequences[..., LENGTH, None] > 0.0, path.shape)
    owner, push, number = np.nonzero(moving)
    nudged = sequences[owner]
    nudged[np.arange(len(owner)), push, PATH.start + number] += inwards[moving]
    rise = search.probe(inside_limits(nudged, limits)) - costs[owner]
    slopes = np.zeros_like(sequences)
    slopes[..., PATH][moving] = np.where(np.isfinite(rise), rise / inwards[moving], 0.0)
    return slopes


def _step(
    search: Search,
    sequences: PushSequences,
    costs: Scalars,
    downhill: PushSequences,
    rates: Float[ndarray, "R"],
) -> tuple[PushSequences, Scalars]:
    """Return where the best of several rates leads each sequence; it stays where all are worse."""
    limits = search.feasibility.limits
    count, tries = len(sequences), len(rates)
    tried = sequences[:, None] + rates[:, None, None] * downhill[:, None]  # (S, R, H, 3)
    tried = inside_limits(tried.reshape(-1, *sequences.shape[1:]), limits)
    tried = without_idle(tried, limits)
    after = search.probe(tried).reshape(count, tries)
    best = after.argmin(axis=1)
    lowest = after[np.arange(count), best]
    lower = lowest < costs
    chosen = tried[tries * np.arange(count) + best]
    moved = np.where(lower[:, None, None], chosen, sequences)
    return moved, np.where(lower, lowest, costs)


class Adam:
    """Directions from running means of slopes and of their squares (Kingma and Ba 2015)."""

    def __init__(self, settings: GradientConfig) -> None:
        """Begin without a past."""
        self.first, self.second = settings.momentum, settings.squares
        self.mean = self.square = np.zeros(1)
        self.steps = 0

    def direction(self, slopes: PushSequences) -> PushSequences:
        """Return the direction (S, H, 3) of Algorithm 1's step, uphill; the rate is not in it."""
        self.steps += 1
        self.mean = self.first * self.mean + (1.0 - self.first) * slopes
        self.square = self.second * self.square + (1.0 - self.second) * slopes**2
        mean = self.mean / (1.0 - self.first**self.steps)
        square = self.square / (1.0 - self.second**self.steps)
        return np.asarray(mean / (np.sqrt(square) + TINY))
