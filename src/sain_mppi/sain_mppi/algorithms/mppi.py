"""MPPI as the paper states it (Algorithm 1, lines 20 to 31; Williams et al. 2017)."""

import numpy as np

from sain_core.types import PushSequences
from sain_mppi.algorithms.config import MEAN
from sain_mppi.algorithms.sampling import gaussian_sequences, weighted_mean
from sain_mppi.algorithms.search import Search


def mppi(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Sample K sequences of H pushes, roll them out, take the cheapest or the weighted mean.

    Drawn about what the last plan leaves, at first from all pushes there are. The paper takes
    the cheapest; MPPI proper the mean with weights exp(-cost / lambda).
    """
    config, limits = search.config, search.feasibility.limits

    def draw(count: int) -> PushSequences:
        if not len(start):
            return search.uniform(generator, count)
        deviations = config.noise.deviations(0)
        return gaussian_sequences(start[0], deviations, 1.0, limits, generator, count)

    sequences = search.draw_permitted(draw, config.samples, generator)
    costs = search.evaluate(sequences)
    if config.selection == MEAN:
        search.settle_on(weighted_mean(sequences, search.weights(costs)))
