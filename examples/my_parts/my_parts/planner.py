"""A planner: random search, then random changes of the best."""

import numpy as np

from sain_core.types import PushSequences
from sain_mppi.algorithms.proposals import draw_permitted
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.sampling import gaussian_sequences


def plan(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Evaluate sequences until the time is over; the search keeps the cheapest."""
    config, objective, limits = search.config, search.objective, search.feasibility.limits

    def draw(count: int) -> PushSequences:
        informed = objective.candidates(search.scene, generator, count // 2, config.horizon)
        uniform = objective.uniform(generator, count - len(informed), config.horizon)
        return np.concatenate([informed, uniform])

    def change(count: int) -> PushSequences:
        best, scale = search.elites.sequences[0], config.noise.deviations(0)
        return gaussian_sequences(best, scale, 0.5, limits, generator, count)

    search.evaluate(draw_permitted(search, draw, config.samples, generator))
    while not search.over and search.rounds < config.rounds:
        search.evaluate(draw_permitted(search, change, config.samples, generator))
