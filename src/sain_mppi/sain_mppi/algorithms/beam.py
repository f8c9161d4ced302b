"""A beam search over pushes: proposals that build on what the model predicts of each push."""

import numpy as np

from sain_core.push import idle_pushes
from sain_core.types import PushSequences
from sain_mppi.algorithms.proposals import draw_permitted
from sain_mppi.algorithms.search import Search


def beam(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Try single pushes, keep the best, try pushes after each of these, and so on up to H.

    The best of what the last plan leaves, `start`, is tried as well.

    A prefix costs what it costs to rest after it. A corner that is pushed turns away, so a
    sequence that is drawn as a whole rarely has a second push that suits its first.
    """
    config, horizon = search.config.beam, search.config.horizon

    def draw(count: int) -> PushSequences:
        informed = search.objective.candidates(search.scene, generator, count // 4, horizon)
        uniform = search.objective.uniform(generator, count - len(informed), horizon)
        sequences = generator.permutation(np.concatenate([informed, uniform]))
        sequences[:, 1:] = idle_pushes()
        return sequences

    sequences = draw_permitted(search, draw, config.first, generator)
    sequences[:, 1:] = idle_pushes()  # of the uniform draws in a hard place
    search.probe(start[:1])
    for step in range(1, horizon + 1):
        costs = search.probe(sequences)
        best = np.argsort(costs, kind="stable")[: config.width]
        best = best[np.isfinite(costs[best])]
        if step == horizon or not len(best) or search.over:
            return
        sequences = np.repeat(sequences[best], config.branch, axis=0)
        sequences[:, step] = search.objective.uniform(generator, len(sequences), 1)[:, 0]
