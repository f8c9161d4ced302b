"""A planner: random search, then random changes of the best."""

import numpy as np

from sain_core.types import PushSequences
from sain_mppi.algorithms.sampling import gaussian_sequences
from sain_mppi.algorithms.search import Search


def plan(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Evaluate sequences until the time is over; the search keeps the cheapest."""
    config, limits = search.config, search.feasibility.limits

    def draw(count: int) -> PushSequences:
        informed = search.candidates(generator, count // 2)
        uniform = search.uniform(generator, count - len(informed))
        return np.concatenate([informed, uniform])

    def change(count: int) -> PushSequences:
        best, scale = search.elites.sequences[0], config.deviations(0)
        return gaussian_sequences(best, scale, 0.5, limits, generator, count)

    search.evaluate(search.draw_permitted(draw, config.samples, generator))
    while not search.over and search.rounds < config.rounds:
        search.evaluate(search.draw_permitted(change, config.samples, generator))
