"""iCEM, the improved cross-entropy method (Pinneri et al. 2020, Algorithm 1)."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LOCATION, PATH
from sain_core.scene import wrap_angle
from sain_core.types import PushSequences, Scalars
from sain_mppi.algorithms.sampling import PushSequence, coloured_noise, stop_early, weighted_mean
from sain_mppi.algorithms.search import Search
from sain_mppi.config import MEAN, IcemConfig
from sain_mppi.objective.proposals import inside_limits


def icem(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Fit mean and deviation to the elites of a shrinking population; keep some elites.

    The first population has the elites that the last plan leaves. At the first plan, when nothing
    is known that could be a mean, it is drawn from everywhere, with informed candidates.
    """
    config, fit = search.config, None
    if len(start):
        fit = EliteSpread(start[0], np.tile(config.noise.deviations(0), (config.horizon, 1)), start)
    for round_number in range(config.rounds):
        if round_number and search.over:
            break
        last = round_number == config.rounds - 1
        draw = partial(_population, search, fit, last, generator)
        count = config.samples_in(round_number)
        sequences = search.draw_permitted(draw, count, generator)
        fit = _refit(fit, sequences, search.evaluate(sequences), config.icem)
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
    noise = coloured_noise(generator, (count, 3, config.horizon), config.icem.colour)
    limits = search.feasibility.limits
    drawn = np.repeat(fit.mean[None], count, axis=0)
    drawn[..., PATH] += fit.deviation * noise.transpose(0, 2, 1)
    drawn = inside_limits(drawn, limits)
    drawn = search.without_idle(stop_early(drawn, config.stop_share, generator))
    known = [fit.kept, fit.mean[None]] if last else [fit.kept]
    return np.concatenate([*known, drawn])


def _refit(
    fit: EliteSpread | None, sequences: PushSequences, costs: Scalars, settings: IcemConfig
) -> EliteSpread:
    """Return mean and deviation of the elites, with some of the last ones kept."""
    order = np.argsort(costs, kind="stable")[: settings.elites]
    elites = sequences[order[np.isfinite(costs[order])]]
    kept = elites[: round(settings.kept * len(elites))]
    mean = weighted_mean(elites, np.full(len(elites), 1.0 / len(elites)))
    apart = elites - mean
    apart[..., LOCATION] = wrap_angle(apart[..., LOCATION])
    deviation = np.sqrt(np.square(apart[..., PATH]).mean(axis=0))
    if fit is None:
        return EliteSpread(mean, deviation, kept)
    share = np.array([settings.momentum, 1.0 - settings.momentum])
    mean = weighted_mean(np.stack([fit.mean, mean]), share)
    return EliteSpread(mean, np.tensordot(share, [fit.deviation, deviation], axes=1), kept)
