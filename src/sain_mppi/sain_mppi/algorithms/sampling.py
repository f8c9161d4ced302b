"""Sequences of pushes: drawn about a mean, averaged, weighed as MPPI does, and the best kept."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import OutOfRangeError
from sain_core.goal import Goal
from sain_core.push import BODY, LENGTH, LOCATION, PATH, PushLimits, idle_pushes
from sain_core.scene import wrap_angle
from sain_core.types import (
    PredictedScenes,
    PushArray,
    Pushes,
    PushSequences,
    Scalars,
    Scene,
    Scenes,
)
from sain_mppi.objective.proposals import inside_limits

PushSequence = Float[ndarray, "H 5"]


def gaussian_sequences(
    mean: PushSequence | PushSequences,
    deviations: Float[ndarray, "3"],
    spread: float,
    limits: PushLimits,
    generator: np.random.Generator,
    count: int,
) -> PushSequences:
    """Draw sequences (count, H, 5) about a mean (H, 5), or each about its own (count, H, 5).

    Each has its own scale of noise.
    """
    scale = np.exp(generator.uniform(np.log(spread), 0.0, (count, 1, 1)))
    drawn = np.broadcast_to(mean, (count, *mean.shape[-2:])).copy()
    noise = generator.standard_normal(drawn[..., PATH].shape) * deviations * scale
    drawn[..., PATH] += noise
    return inside_limits(drawn, limits)


def stop_early(
    sequences: PushSequences, share: float, generator: np.random.Generator
) -> PushSequences:
    """Let a share of the sequences rest after a random push, so that the plan can be short."""
    count, horizon, _ = sequences.shape
    stop = generator.integers(1, horizon + 1, count)
    stop[generator.uniform(size=count) >= share] = horizon
    stopped = sequences.copy()
    stopped[..., LENGTH] *= np.arange(horizon) < stop[:, None]
    return stopped


def weighted_mean(sequences: PushSequences, weights: Scalars) -> PushSequence:
    """Return the mean (H, 5) of sequences (K, H, 5); locations are averaged on the circle.

    Each push of the mean is of those against the body with most weight.
    """
    bodies = sequences[0, :, BODY]
    if (sequences[..., BODY] != bodies).any():
        return np.stack([_mean_push(step, weights) for step in sequences.swapaxes(0, 1)])
    mean = np.einsum("k,khp->hp", weights, sequences)
    sine = weights @ np.sin(sequences[..., LOCATION])
    cosine = weights @ np.cos(sequences[..., LOCATION])
    mean[:, LOCATION], mean[:, BODY] = wrap_angle(np.arctan2(sine, cosine)), bodies
    return mean


def _mean_push(pushes: Pushes, weights: Scalars) -> PushArray:
    """Return the mean (5,) of the pushes (K, 5) against the body that has most of the weight."""
    _, which = np.unique(pushes[:, BODY], return_inverse=True)
    best = int(np.argmax(np.bincount(which, weights=weights)))
    mine = which == best
    of_body = weights[mine] / weights[mine].sum()
    return np.asarray(weighted_mean(pushes[mine, None], of_body)[0])


def shift(sequences: PushSequences) -> PushSequences:
    """Drop the first push of sequences (K, H, 5), which was executed, and rest at their ends."""
    shifted = np.roll(sequences, -1, axis=-2)
    shifted[..., -1, :] = idle_pushes()
    return shifted


def softmin_weights(costs: Scalars, temperature: float) -> Scalars:
    """Return weights (K,) proportional to exp(-cost / temperature), which sum to 1.

    The heart of MPPI (Williams et al. 2017, eq. 34).

    Args:
        costs: (K,), at least one finite; infinite ones get no weight.
        temperature: lambda, in the unit of the costs. As it goes to 0 the weights pick the
            cheapest sample; at exactly 0 they do, shared equally among ties.

    Raises:
        OutOfRangeError: no finite cost, or a negative temperature.
    """
    if temperature < 0:
        raise OutOfRangeError(f"temperature is {temperature}; it must not be negative")
    cheapest = costs.min(initial=np.inf)
    if not np.isfinite(cheapest):
        raise OutOfRangeError("no cost is finite; softmin weights need at least one that is")
    excess = costs - cheapest
    if temperature == 0.0:
        weights = (excess == 0.0).astype(np.float64)
    else:
        with np.errstate(over="ignore"):  # a tiny temperature sends far costs to exp(-inf) = 0
            weights = np.exp(-excess / temperature)
    return np.asarray(weights / weights.sum())


def cost_spread(costs: Scalars) -> float:
    """Return the gap between the median and the smallest finite cost, the scale of a round.

    A temperature relative to it means the same 30 cm from the goal and 1 cm from it.
    """
    finite = np.asarray(costs)[np.isfinite(costs)]
    return float(np.median(finite) - finite.min())


def effective_samples(weights: Scalars) -> float:
    """Return how many equally weighted samples the weights (K,) are worth (Kish 1965): 1 to K."""
    return float(1.0 / np.square(weights).sum())


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


@dataclass(frozen=True, eq=False)
class WarmStart:
    """What a plan leaves for the next one; nothing before the first."""

    # (E, H, 5), good ones, the best first
    sequences: PushSequences = field(default_factory=lambda: idle_pushes(0, 0))
    scene: Scene | None = None  # (N, 8), that they begin from
    goal: Goal | None = None  # that they were planned for
    prepared: PushSequences | None = None  # (E, H, 5), planned for the scene that is expected next

    def prepared_for(self, goal: Goal, refused: bool) -> PushSequences | None:
        """Return what was prepared, if it is for this goal and no push was refused since."""
        return None if refused or goal != self.goal else self.prepared


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
    rest: WarmStart  # what the next plan may begin from
    regions: Float[ndarray, "H N"] | None = None  # [m], radii that should hold each disk

    @property
    def push(self) -> PushArray:
        """The push (5,) to execute."""
        return np.asarray(self.pushes[0])

    @property
    def improves(self) -> bool:
        """Whether the plan is expected to be better than doing nothing."""
        return self.cost < self.rest_cost


class Tried(NamedTuple):
    """K sequences, where they lead, and what they cost: by term, and in all."""

    sequences: PushSequences
    predicted: PredictedScenes
    costs: Scalars
    terms: dict[str, Scalars]


class Elites:
    """The best sequences in order, and what the very best leads to and costs."""

    def __init__(self, horizon: int, shown: int) -> None:
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

    def add(self, tried: Tried) -> None:
        """Keep what is worth it of some sequences."""
        costs = tried.costs
        self._shown.append(Shown.of(tried.predicted, costs, self._count))
        best = np.argsort(costs, kind="stable")[:MOST_ELITES]
        best = best[np.isfinite(costs[best])]
        every = np.concatenate([self._costs, costs[best]])
        order = np.argsort(every, kind="stable")[:MOST_ELITES]
        self.sequences = np.concatenate([self.sequences, tried.sequences[best]])[order]
        self._costs = every[order]
        if len(best) and costs[best[0]] < self.cost:
            self._note(tried, int(best[0]))

    def prefer(self, tried: Tried) -> None:
        """Take the first of some sequences for the best, whatever it costs."""
        self.sequences = np.concatenate([tried.sequences[:1], self.sequences])[:MOST_ELITES]
        self._costs = np.concatenate([tried.costs[:1], self._costs])[:MOST_ELITES]
        self._note(tried, 0)

    def _note(self, tried: Tried, row: int) -> None:
        self.cost, self._predicted = float(tried.costs[row]), tried.predicted[row].copy()
        self.terms = {name: float(values[row]) for name, values in tried.terms.items()}
