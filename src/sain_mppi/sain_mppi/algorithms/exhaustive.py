"""Exhaustive search over the paper's grid of pushes, one step ahead."""

import numpy as np

from sain_core.errors import NoPushError
from sain_core.push import idle_pushes
from sain_core.types import PushSequences
from sain_mppi.algorithms.search import Search


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
