"""MPPI: as the paper states it, in rounds, and the paper's exhaustive search beside it."""

from functools import partial
from typing import Final

import numpy as np

from sain_core.errors import NoPushError
from sain_core.push import idle_pushes
from sain_core.types import PushSequences
from sain_mppi.algorithms.sampling import PushSequence, gaussian_sequences, weighted_mean
from sain_mppi.algorithms.search import Search
from sain_mppi.config import MEAN

SMOOTHING: Final = 0.1  # share of the last mean that an update keeps
WIDTH: Final = 16  # sequences that a beam search keeps after each push
BRANCH: Final = 12  # next pushes that it tries after each of them
BEAM_SHARE: Final = 0.5  # of the samples of the rounds that follow it


def mppi(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Sample K sequences of H pushes, roll them out, take the cheapest or the weighted mean.

    Drawn about what the last plan leaves, at first from all pushes there are. The paper takes
    the cheapest; MPPI proper the mean with weights exp(-cost / lambda).
    """
    config, limits = search.config, search.feasibility.limits

    def draw(count: int) -> PushSequences:
        if not len(start):
            return search.uniform(generator, count)
        deviations = config.deviations(0)
        return gaussian_sequences(start[0], deviations, 1.0, limits, generator, count)

    sequences = search.draw_permitted(draw, config.samples, generator)
    costs = search.evaluate(sequences)
    if config.selection == MEAN:
        search.settle_on(weighted_mean(sequences, search.weights(costs)))


def mppi_rounds(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Sample, roll out, weigh, and again about the weighted mean, with less noise.

    Informed candidates are among the samples of every round. More rounds, as wide as the first,
    follow when nothing was found that is better than doing nothing.
    """
    config, mean = search.config, start[0] if len(start) else None
    share = 1.0
    if config.beam and search.objective.has_corners:
        share = BEAM_SHARE
        beam(search, start, generator)
        mean = search.elites.sequences[0] if search.improves else mean
    for round_number in range(config.rounds + config.stuck_rounds):
        stuck = round_number >= config.rounds
        found = len(search.elites.sequences) > 0
        if found and (search.over or (stuck and search.improves)):
            break
        wide = 0 if stuck else round_number
        draw = partial(search.propose, mean, wide, generator)
        count = max(round(share * config.samples_in(wide)), 1)
        sequences = search.draw_permitted(draw, count, generator)
        costs = search.evaluate(sequences)
        mean = _updated(mean, weighted_mean(sequences, search.weights(costs)), SMOOTHING)
    if config.selection == MEAN and mean is not None:
        search.settle_on(mean)


def beam(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Try single pushes, keep the best, try pushes after each of these, and so on up to H.

    The best of what the last plan leaves, `start`, is tried as well.

    A prefix costs what it costs to rest after it. A corner that is pushed turns away, so a
    sequence that is drawn as a whole rarely has a second push that suits its first.
    """
    horizon = search.config.horizon

    def draw(count: int) -> PushSequences:
        informed = search.candidates(generator, count // 4)
        uniform = search.uniform(generator, count - len(informed))
        sequences = generator.permutation(np.concatenate([informed, uniform]))
        sequences[:, 1:] = idle_pushes()
        return sequences

    sequences = search.draw_permitted(draw, search.config.beam, generator)
    sequences[:, 1:] = idle_pushes()  # of the uniform draws in a hard place
    search.probe(start[:1])
    for step in range(1, horizon + 1):
        costs = search.probe(sequences)
        best = np.argsort(costs, kind="stable")[:WIDTH]
        best = best[np.isfinite(costs[best])]
        if step == horizon or not len(best) or search.over:
            return
        sequences = np.repeat(sequences[best], BRANCH, axis=0)
        sequences[:, step] = search.uniform(generator, len(sequences))[:, 0]


def _updated(mean: PushSequence | None, new: PushSequence, kept: float) -> PushSequence:
    """Return the new mean with a share of the last one kept."""
    if mean is None:
        return new
    return weighted_mean(np.stack([mean, new]), np.array([kept, 1.0 - kept]))


def exhaustive(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
    """Try every push of the grid, each followed by rest; nothing is drawn.

    With a horizon of H the others have H - 1 rests, so that costs compare with other planners'.
    """
    every = search.config.grid.pushes()
    grid = every[search.permitted(every)]
    if not len(grid):
        raise NoPushError(
            f"none of the grid's {len(every)} pushes can be carried out {search.where}"
        )
    sequences = idle_pushes(len(grid), search.config.horizon)
    sequences[:, 0] = grid
    search.evaluate(sequences)
