"""The planners by name: each a function that reads like its algorithm, all with one contract."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

import numpy as np

from sain_core.types import PushSequences
from sain_mppi.algorithms.mppi import exhaustive, mppi, mppi_rounds
from sain_mppi.algorithms.search import Search
from sain_mppi.config import EXHAUSTIVE, MPPI, MPPI_ROUNDS, PLANNERS

Algorithm = Callable[[Search, PushSequences, np.random.Generator], None]
"""Evaluates sequences in a search, which keeps the cheapest, until it is good or over.

It gets good sequences that the last plan leaves, (E, H, 3), the best first; none at the first plan.
At least one sequence must be evaluated. Raises `NoPushError` where no first push is permitted.
"""

ALGORITHMS: Final[Mapping[str, Algorithm]] = {
    MPPI_ROUNDS: mppi_rounds,
    MPPI: mppi,
    EXHAUSTIVE: exhaustive,
}


@cache
def find_algorithm(name: str) -> Algorithm:
    """Return the algorithm of this name, which an installed package may offer.

    Raises `ConfigError`: no package offers it, two do, or its package fails.
    """
    if name in ALGORITHMS:
        return ALGORITHMS[name]
    entry, algorithm = PLANNERS.function(name)

    def search_with(search: Search, start: PushSequences, generator: np.random.Generator) -> None:
        algorithm(search, start, generator)
        if not len(search.elites.sequences):
            raise PLANNERS.wrong(
                entry, "it found no sequence of finite cost; it must call search.evaluate"
            )

    return search_with
