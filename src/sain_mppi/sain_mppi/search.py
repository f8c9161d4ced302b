"""One plan's search: rolls out what an algorithm tries, costs it, and keeps the best."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import monotonic, perf_counter
from typing import Final

import numpy as np

from sain_core.dynamics import Radii, RegionModel, RolloutModel
from sain_core.errors import ModelUnavailableError
from sain_core.feasibility import Feasibility
from sain_core.scene import MID, POSITION
from sain_core.types import (
    Mask,
    PredictedScenes,
    PushArray,
    Pushes,
    PushSequences,
    Scalars,
    Scene,
    Scenes,
)
from sain_mppi.answers import check_answer
from sain_mppi.config import PlannerConfig
from sain_mppi.cost import cost_terms, make_rollout, resting_cost, total_cost
from sain_mppi.goal import Goal
from sain_mppi.permission import permitted
from sain_mppi.result import PlanResult, Shown, Times
from sain_mppi.weights import cost_spread, effective_samples, softmin_weights

ELITES: Final = 16  # sequences that the next plan may begin from
FIRST_PART: Final = 64  # sequences, under a deadline: until it is known how long they take
PART: Final = 256
RESERVE: Final = 0.002  # [s] before a deadline, for what comes after the search


@dataclass(frozen=True)
class Problem:
    """What a plan is for.

    Attributes:
        scene: (N, 8), where it starts.
        goal: (2,), for the target.
        feasibility: what the arm can do.
        refused: (3,) each, pushes that were refused from this scene.
        deadline: `time.monotonic` at which the plan is wanted; None: whenever.
    """

    scene: Scene
    goal: Goal
    feasibility: Feasibility
    refused: Sequence[PushArray] = ()
    deadline: float | None = None


class Search:
    """What algorithms see: which pushes are permitted, what sequences cost, when to stop."""

    def __init__(self, model: RolloutModel, config: PlannerConfig, problem: Problem) -> None:
        """Begin with nothing found."""
        self.model, self.config, self.problem = model, config, problem
        self.scene, self.goal, self.feasibility = problem.scene, problem.goal, problem.feasibility
        self.cost, self.effective = np.inf, 0.0
        self.samples = self.rounds = 0
        self.elites = np.empty((0, config.horizon, 3))  # the best, in order
        self._elite_costs = np.empty(0)
        self._best: tuple[Scenes, dict[str, float]] | None = None
        self._shown: list[Shown] = []
        self._rollout_time = self._cost_time = self._pace = 0.0
        self._began = self._idle_since = perf_counter()
        self._between = 0.0  # [s], longest that an algorithm took from one round to the next
        self.rest_cost = resting_cost(
            self.scene, self.goal, config.weights, self.feasibility, config.horizon
        )

    @property
    def improves(self) -> bool:
        """Whether the best sequence so far is better than doing nothing."""
        return bool(self.cost < self.rest_cost)

    @property
    def over(self) -> bool:
        """Whether there is no time left for another round."""
        return self._late(self._between + FIRST_PART * self._pace)

    @property
    def where(self) -> str:
        """The situation, for messages."""
        x, y = self.scene[MID, POSITION]
        refused = f", {len(self.problem.refused)} refused before" if self.problem.refused else ""
        return f"from here: mid disk at ({x:.3f}, {y:.3f}) m{refused}"

    def permitted(self, pushes: Pushes) -> Mask:
        """Tell which pushes (B, 3) touch the mid disk, can be carried out, and were not refused."""
        return permitted(self.scene, pushes, self.feasibility, self.problem.refused)

    def evaluate(self, sequences: PushSequences) -> Scalars:
        """Roll out sequences (K, H, 3) and return what they cost (K,); their first pushes must be
        permitted.

        The cost is infinite where the prediction is not finite, and where the deadline came first.

        Raises:
            ModelUnavailableError: no cost is finite, or the answer is not one to this question.
        """
        costs = self._try(sequences)
        self.rounds += 1
        if not np.isfinite(costs).any():
            raise ModelUnavailableError(
                f"none of the model's {len(sequences)} predictions is finite; check its checkpoint"
            )
        self.effective = effective_samples(self.weights(costs))
        return costs

    def probe(self, sequences: PushSequences) -> Scalars:
        """Return what variants (K, H, 3) of evaluated sequences cost (K,); they are no round.

        Infinite as in `evaluate`, and where a first push is not permitted, all if need be.
        """
        costs = np.full(len(sequences), np.inf)
        allowed = self.permitted(sequences[:, 0])
        if allowed.any():
            costs[allowed] = self._try(sequences[allowed])
        return costs

    def weights(self, costs: Scalars) -> Scalars:
        """Return MPPI's weights (K,) for costs (K,); lambda is relative to how they spread."""
        return softmin_weights(costs, self.config.temperature * cost_spread(costs))

    def settle_on(self, sequence: Pushes) -> None:
        """Take one sequence (H, 3) as the plan, whatever else was found, if it can be done."""
        if not self.permitted(sequence[:1]).all():
            return
        predicted = self._rollout(sequence[None])
        costs, terms = self._costs(sequence[None], predicted)
        if np.isfinite(costs[0]):
            self.cost = np.inf
            self._keep(sequence[None], predicted, costs, terms)
            self.elites = np.concatenate([sequence[None], self.elites])[:ELITES]
            self._elite_costs = np.concatenate([costs, self._elite_costs])[:ELITES]

    def result(self) -> PlanResult:
        """Return the best sequence as the plan; something must have been evaluated."""
        assert self._best is not None
        predicted, terms = self._best
        regions = self.regions(self.elites[:1], predicted[None])
        total = perf_counter() - self._began
        times = Times(total, self._rollout_time, self._cost_time)
        return PlanResult(
            self.elites[0],
            predicted,
            self.cost,
            self.rest_cost,
            terms,
            self.effective,
            self.samples,
            self.rounds,
            times,
            Shown.thinned(self._shown, self.config.shown),
            None if regions is None else regions[0],
        )

    def regions(self, sequences: PushSequences, predicted: PredictedScenes) -> Radii | None:
        """Return how sure the model is of its predictions, where it can tell."""
        if not isinstance(self.model, RegionModel):
            return None
        begun = perf_counter()
        regions = self.model.regions(self.scene, sequences, predicted)
        self._rollout_time += perf_counter() - begun
        return regions

    def _try(self, sequences: PushSequences) -> Scalars:
        self._between = max(self._between, perf_counter() - self._idle_since)
        costs = np.full(len(sequences), np.inf)
        for part in self._parts(len(sequences)):
            costs[part] = self._evaluate(sequences[part])
            self.samples += part.stop - part.start
        self._idle_since = perf_counter()
        return costs

    def _parts(self, count: int) -> Iterator[slice]:
        """Yield parts of a round: one, or under a deadline as many as there is time for.

        The first is small, and always there: whether there is time for it, `over` tells.
        """
        if self.problem.deadline is None:
            yield slice(0, count)
            return
        start = 0
        while start < count:
            hurried = not start or self._late(PART * self._pace)
            size = FIRST_PART if hurried else PART
            part = slice(start, min(start + size, count))
            if start and self._late((part.stop - part.start) * self._pace):
                return
            begun = perf_counter()
            yield part
            start = part.stop
            self._pace = max(self._pace, (perf_counter() - begun) / (part.stop - part.start))

    def _late(self, needed: float) -> bool:
        """Tell whether so many seconds more are too many."""
        deadline = self.problem.deadline
        return deadline is not None and monotonic() + needed + RESERVE > deadline

    def _evaluate(self, sequences: PushSequences) -> Scalars:
        predicted = self._rollout(sequences)
        costs, terms = self._costs(sequences, predicted)
        self._keep(sequences, predicted, costs, terms)
        self._shown.append(Shown.of(predicted, costs, self.config.shown))
        best = np.argsort(costs, kind="stable")[:ELITES]
        best = best[np.isfinite(costs[best])]
        every = np.concatenate([self._elite_costs, costs[best]])
        order = np.argsort(every, kind="stable")[:ELITES]
        self.elites = np.concatenate([self.elites, sequences[best]])[order]
        self._elite_costs = every[order]
        return costs

    def _rollout(self, sequences: PushSequences) -> PredictedScenes:
        begun = perf_counter()
        predicted = self.model.rollout(self.scene, sequences)
        self._rollout_time += perf_counter() - begun
        return check_answer(predicted, self.scene, sequences)

    def _costs(
        self, sequences: PushSequences, predicted: PredictedScenes
    ) -> tuple[Scalars, dict[str, Scalars]]:
        regions = self.regions(sequences, predicted) if self.config.weights.risk > 0.0 else None
        begun = perf_counter()
        rollout = make_rollout(self.scene, sequences, predicted, self.goal, regions)
        terms = cost_terms(rollout, self.config.weights, self.feasibility)
        costs = total_cost(terms)
        self._cost_time += perf_counter() - begun
        return costs, terms

    def _keep(
        self,
        sequences: PushSequences,
        predicted: PredictedScenes,
        costs: Scalars,
        terms: dict[str, Scalars],
    ) -> None:
        best = int(np.argmin(costs))
        if costs[best] < self.cost:
            self.cost = float(costs[best])
            chosen = {name: float(values[best]) for name, values in terms.items()}
            self._best = predicted[best].copy(), chosen
