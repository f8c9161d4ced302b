"""A planner that is in the literature: iCEM, the improved cross-entropy method.

Pinneri et al. 2020, Algorithm 1; the names of its numbers are theirs.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LOCATION, PATH
from sain_core.scene import wrap_angle
from sain_core.types import PushSequences, Scalars
from sain_mppi.algorithms.sampling import PushSequence, stop_early, weighted_mean
from sain_mppi.algorithms.search import Search
from sain_mppi.config import MEAN
from sain_mppi.objective.proposals import inside_limits

ELITES: Final = 10  # K, best samples to which mean and deviation are fitted
KEPT: Final = 0.3  # xi, share of the elites kept for the next round
COLOUR: Final = 1.0  # beta, power of the noise's spectrum: 0 white, 2 a random walk
MOMENTUM: Final = 0.1  # alpha, share of the last mean and deviation that an update keeps


def plan(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Fit mean and deviation to the elites of a shrinking population; keep some elites.

    The first population has the elites that the last plan leaves. At the first plan, when nothing
    is known that could be a mean, it is drawn from everywhere, with informed candidates.
    """
    config, fit = search.config, None
    if len(start):
        fit = EliteSpread(start[0], np.tile(config.deviations(0), (config.horizon, 1)), start)
    for round_number in range(config.rounds):
        if round_number and search.over:
            break
        last = round_number == config.rounds - 1
        draw = partial(_population, search, fit, last, generator)
        count = config.samples_in(round_number)
        sequences = search.draw_permitted(draw, count, generator)
        fit = _refit(fit, sequences, search.evaluate(sequences))
    if config.selection == MEAN and fit is not None:
        search.settle_on(fit.mean)


@dataclass(frozen=True)
class EliteSpread:
    """What the next population is drawn from."""

    mean: PushSequence
    deviation: Float[ndarray, "H 3"]  # of location, angle and length
    kept: PushSequences  # elites that come along as they are


def _population(
    search: Search, fit: EliteSpread | None, last: bool, generator: np.random.Generator, count: int
) -> PushSequences:
    """Draw sequences with noise that is correlated over H; the last have the mean among them."""
    if fit is None:
        return search.propose(None, 0, generator, count)
    config = search.config
    noise = _coloured_noise(generator, (count, 3, config.horizon), COLOUR)
    limits = search.feasibility.limits
    drawn = np.repeat(fit.mean[None], count, axis=0)
    drawn[..., PATH] += fit.deviation * noise.transpose(0, 2, 1)
    drawn = inside_limits(drawn, limits)
    drawn = search.without_idle(stop_early(drawn, config.stop_share, generator))
    known = [fit.kept, fit.mean[None]] if last else [fit.kept]
    return np.concatenate([*known, drawn])


def _coloured_noise(
    generator: np.random.Generator, shape: tuple[int, ...], colour: float
) -> Float[ndarray, "..."]:
    """Draw noise of variance 1 whose power falls with frequency^colour along the last axis.

    After Timmer and Koenig 1995: random amplitudes in the frequency domain. The mean over the
    axis counts as the lowest frequency there is, so that a whole sequence may shift.
    """
    length = shape[-1]
    frequency = np.maximum(np.fft.rfftfreq(length), 1.0 / length)
    scale = frequency ** (-colour / 2.0)
    draws = generator.standard_normal((2, *shape[:-1], len(scale)))
    spectrum = scale * (draws[0] + 1j * draws[1])
    real = np.zeros(len(scale), bool)
    real[0] = True
    real[-1] |= length % 2 == 0  # the highest frequency of an even length
    spectrum[..., real] = 2**0.5 * spectrum[..., real].real
    power = scale**2 * np.where(real, 1.0, 2.0)
    deviation = np.sqrt(2.0 * power.sum()) / length
    return np.asarray(np.fft.irfft(spectrum, n=length, axis=-1) / deviation)


def _refit(fit: EliteSpread | None, sequences: PushSequences, costs: Scalars) -> EliteSpread:
    """Return mean and deviation of the elites, with some of the last ones kept."""
    order = np.argsort(costs, kind="stable")[:ELITES]
    elites = sequences[order[np.isfinite(costs[order])]]
    kept = elites[: round(KEPT * len(elites))]
    mean = weighted_mean(elites, np.full(len(elites), 1.0 / len(elites)))
    apart = elites - mean
    apart[..., LOCATION] = wrap_angle(apart[..., LOCATION])
    deviation = np.sqrt(np.square(apart[..., PATH]).mean(axis=0))
    if fit is None:
        return EliteSpread(mean, deviation, kept)
    share = np.array([MOMENTUM, 1.0 - MOMENTUM])
    mean = weighted_mean(np.stack([fit.mean, mean]), share)
    return EliteSpread(mean, np.tensordot(share, [fit.deviation, deviation], axes=1), kept)
