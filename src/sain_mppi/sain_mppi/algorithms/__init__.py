"""The planners by name: each a function that reads like its algorithm, all with one contract."""

from collections.abc import Mapping
from typing import Final, Protocol

import numpy as np

from sain_core.types import PushSequences
from sain_mppi.algorithms.exhaustive import exhaustive
from sain_mppi.algorithms.gradient import gradient
from sain_mppi.algorithms.icem import icem
from sain_mppi.algorithms.mppi import mppi
from sain_mppi.algorithms.mppi_rounds import mppi_rounds
from sain_mppi.search.config import EXHAUSTIVE, GRADIENT, ICEM, MPPI, MPPI_ROUNDS, PlannerConfig
from sain_mppi.search.search import Search


class Algorithm(Protocol):
    """Looks for a cheap sequence of pushes."""

    def __call__(
        self,
        search: Search,
        start: PushSequences,
        config: PlannerConfig,
        generator: np.random.Generator,
    ) -> None:
        """Evaluate sequences in a search, which keeps the cheapest, until it is good or over.

        Args:
            search: rolls out, costs and remembers. At least one sequence must be evaluated.
            start: (E, H, 3), good sequences that the last plan leaves, the best first; none at
                the first plan.
            config: how to plan.
            generator: of all that is drawn.

        Raises:
            NoPushError: no first push is permitted.
            ModelUnavailableError: nothing that the model predicts is finite.
        """
        ...


ALGORITHMS: Final[Mapping[str, Algorithm]] = {
    MPPI_ROUNDS: mppi_rounds,
    MPPI: mppi,
    ICEM: icem,
    EXHAUSTIVE: exhaustive,
    GRADIENT: gradient,
}
