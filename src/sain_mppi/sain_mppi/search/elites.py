"""What a search has found so far: the best sequences, and some of all kinds to be shown."""

from typing import Final

import numpy as np

from sain_core.types import PredictedScenes, PushSequences, Scalars, Scenes
from sain_mppi.search.result import Shown

MOST_ELITES: Final = 16  # sequences that the next plan may begin from

Terms = dict[str, Scalars]


class Elites:
    """The best sequences in order, and what the very best leads to and costs."""

    def __init__(self, horizon: int, shown: int) -> None:
        """Begin with nothing; keep so many sequences to be shown."""
        self.cost = np.inf
        self.sequences: PushSequences = np.empty((0, horizon, 3))
        self.terms: dict[str, float] = {}
        self._predicted: Scenes | None = None
        self._costs: Scalars = np.empty(0)  # of the elites
        self._shown: list[Shown] = []
        self._count = shown

    @property
    def predicted(self) -> Scenes:
        """Where the best sequence leads, (H, N, 8); there must be one."""
        assert self._predicted is not None
        return self._predicted

    @property
    def shown(self) -> Shown:
        """Some of all sequences, from the cheapest to the dearest."""
        return Shown.thinned(self._shown, self._count)

    def add(
        self, sequences: PushSequences, predicted: PredictedScenes, costs: Scalars, terms: Terms
    ) -> None:
        """Keep what is worth it of some sequences."""
        self._shown.append(Shown.of(predicted, costs, self._count))
        best = np.argsort(costs, kind="stable")[:MOST_ELITES]
        best = best[np.isfinite(costs[best])]
        every = np.concatenate([self._costs, costs[best]])
        order = np.argsort(every, kind="stable")[:MOST_ELITES]
        self.sequences = np.concatenate([self.sequences, sequences[best]])[order]
        self._costs = every[order]
        if len(best) and costs[best[0]] < self.cost:
            self._note(predicted, costs, terms, int(best[0]))

    def prefer(
        self, sequences: PushSequences, predicted: PredictedScenes, costs: Scalars, terms: Terms
    ) -> None:
        """Take the first of some sequences for the best, whatever it costs."""
        self.sequences = np.concatenate([sequences[:1], self.sequences])[:MOST_ELITES]
        self._costs = np.concatenate([costs[:1], self._costs])[:MOST_ELITES]
        self._note(predicted, costs, terms, 0)

    def _note(self, predicted: PredictedScenes, costs: Scalars, terms: Terms, row: int) -> None:
        self.cost, self._predicted = float(costs[row]), predicted[row].copy()
        self.terms = {name: float(values[row]) for name, values in terms.items()}
