"""MPPI with several rounds: each draws nearer the mean of the last, and fewer.

Where the tool pushes bodies with corners, a beam search finds the first mean.
"""

from functools import partial

import numpy as np

from sain_core.types import PushSequences
from sain_mppi.algorithms.beam import beam
from sain_mppi.algorithms.config import MEAN
from sain_mppi.algorithms.proposals import draw_permitted, propose
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.sampling import Sequence, weighted_mean


def mppi_rounds(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Sample, roll out, weigh, and again about the weighted mean, with less noise.

    Informed candidates are among the samples of every round. More rounds, as wide as the first,
    follow when nothing was found that is better than doing nothing.
    """
    config, mean = search.config, start[0] if len(start) else None
    share = 1.0
    if config.beam.first and search.objective.has_corners:
        share = config.beam.samples
        beam(search, start, generator)
        mean = search.elites.sequences[0] if search.improves else mean
    for round_number in range(config.rounds + config.stuck_rounds):
        stuck = round_number >= config.rounds
        found = len(search.elites.sequences) > 0
        if found and (search.over or (stuck and search.improves)):
            break
        wide = 0 if stuck else round_number
        draw = partial(propose, search, mean, wide, generator)
        count = max(round(share * config.samples_in(wide)), 1)
        sequences = draw_permitted(search, draw, count, generator)
        costs = search.evaluate(sequences)
        mean = _updated(mean, weighted_mean(sequences, search.weights(costs)), config.smoothing)
    if config.selection == MEAN and mean is not None:
        search.settle_on(mean)


def _updated(mean: Sequence | None, new: Sequence, kept: float) -> Sequence:
    """Return the new mean with a share of the last one kept."""
    if mean is None:
        return new
    return weighted_mean(np.stack([mean, new]), np.array([kept, 1.0 - kept]))
