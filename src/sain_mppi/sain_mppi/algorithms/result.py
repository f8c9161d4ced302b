"""What a search finds: the best sequences, some of all kinds to be shown, and the plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import idle_pushes
from sain_core.scene import POSITION
from sain_core.types import (
    PredictedScenes,
    PushArray,
    Pushes,
    PushSequences,
    Scalars,
    Scene,
    Scenes,
)

MOST_ELITES: Final = 16  # sequences that the next plan may begin from


@dataclass(frozen=True)
class Times:
    """Where a plan's time went [s]."""

    total: float
    rollout: float  # in the model
    cost: float

    @property
    def sampling(self) -> float:
        """Drawing, masking, weighing and keeping: all the rest."""
        return self.total - self.rollout - self.cost


@dataclass(frozen=True)
class Shown:
    """Some of the sequences that were tried, from the cheapest to the most expensive."""

    predicted: PredictedScenes  # (R, H, N, 8)
    costs: Scalars  # (R,), finite

    def ways(self, scene: Scene, disk: int) -> Float[ndarray, "R S 2"]:
        """Return where each leads a disk, from the scene (N, 8) on: H + 1 places."""
        start = np.broadcast_to(scene[disk, POSITION], (len(self.predicted), 1, 2))
        return np.concatenate([start, self.predicted[:, :, disk, POSITION]], axis=1)

    @classmethod
    def of(cls, predicted: PredictedScenes, costs: Scalars, count: int) -> Self:
        """Return up to so many, evenly spread from the cheapest to the most expensive."""
        order = np.argsort(costs, kind="stable")
        order = order[np.isfinite(costs[order])]
        if len(order) > count:
            order = order[np.linspace(0, len(order) - 1, count).astype(int)]
        return cls(predicted[order], costs[order])

    @classmethod
    def thinned(cls, parts: Sequence[Self], count: int) -> Self:
        """Return up to so many of several parts."""
        predicted = np.concatenate([part.predicted for part in parts])
        return cls.of(predicted, np.concatenate([part.costs for part in parts]), count)


@dataclass(frozen=True)
class PlanResult:
    """What the planner decided and what it expects."""

    pushes: Pushes  # (H, 3); the first is to be executed
    predicted: Scenes  # (H, N, 8), the scene after each push
    cost: float
    rest_cost: float  # of doing nothing: a plan that costs more is a step back
    terms: dict[str, float]  # the cost by term
    effective_samples: float  # of the last round's weights
    samples: int  # sequences rolled out, over all rounds
    rounds: int
    times: Times
    others: Shown
    regions: Float[ndarray, "H N"] | None = None  # [m], radii that should hold each disk

    @property
    def push(self) -> PushArray:
        """The push (5,) to execute."""
        return np.asarray(self.pushes[0])

    def way(self, scene: Scene, disk: int) -> Float[ndarray, "S 2"]:
        """Return where the plan leads a disk, from the scene (N, 8) on: H + 1 places."""
        return np.concatenate([scene[None], self.predicted])[:, disk, POSITION]

    @property
    def improves(self) -> bool:
        """Whether the plan is expected to be better than doing nothing."""
        return self.cost < self.rest_cost


class Elites:
    """The best sequences in order, and what the very best leads to and costs."""

    def __init__(self, horizon: int, shown: int) -> None:
        """Begin with nothing; keep so many sequences to be shown."""
        self.cost = np.inf
        self.sequences: PushSequences = idle_pushes(0, horizon)
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
        self,
        sequences: PushSequences,
        predicted: PredictedScenes,
        costs: Scalars,
        terms: dict[str, Scalars],
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
        self,
        sequences: PushSequences,
        predicted: PredictedScenes,
        costs: Scalars,
        terms: dict[str, Scalars],
    ) -> None:
        """Take the first of some sequences for the best, whatever it costs."""
        self.sequences = np.concatenate([sequences[:1], self.sequences])[:MOST_ELITES]
        self._costs = np.concatenate([costs[:1], self._costs])[:MOST_ELITES]
        self._note(predicted, costs, terms, 0)

    def _note(
        self, predicted: PredictedScenes, costs: Scalars, terms: dict[str, Scalars], row: int
    ) -> None:
        self.cost, self._predicted = float(costs[row]), predicted[row].copy()
        self.terms = {name: float(values[row]) for name, values in terms.items()}
