"""The rounds of one plan: roll out, weigh, keep the best."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from sain_core.dynamics import RolloutModel
from sain_core.errors import ModelUnavailableError
from sain_core.feasibility import Feasibility
from sain_core.types import PredictedScenes, PushArray, PushSequences, Scene, Scenes
from sain_mppi.config import PlannerConfig
from sain_mppi.cost import cost_terms, make_rollout, total_cost
from sain_mppi.goal import Goal
from sain_mppi.sampling import Sequence, weighted_mean
from sain_mppi.weights import cost_spread, effective_samples, softmin_weights


@dataclass(frozen=True)
class PlanResult:
    """What the planner decided and what it expects."""

    pushes: Sequence  # (H, 3); the first is to be executed
    predicted: Scenes  # (H, N, 8), the scene after each push
    cost: float
    rest_cost: float  # of doing nothing: a plan that costs more is a step back
    terms: dict[str, float]  # the cost by term
    effective_samples: float  # of the last round's weights
    samples: int  # sequences rolled out, over all rounds
    rounds: int
    rollout_time: float  # [s], spent in the model
    planning_time: float  # [s], in all

    @property
    def push(self) -> PushArray:
        """The push (3,) to execute."""
        return np.asarray(self.pushes[0])

    @property
    def improves(self) -> bool:
        """Whether the plan is expected to be better than doing nothing."""
        return self.cost < self.rest_cost


class Search:
    """The best sequence over the rounds of one plan, and what finding it took."""

    def __init__(
        self,
        model: RolloutModel,
        config: PlannerConfig,
        feasibility: Feasibility,
        scene: Scene,
        goal: Goal,
    ) -> None:
        """Search from a scene (N, 8) towards a goal (2,)."""
        self.model, self.config, self.feasibility = model, config, feasibility
        self.scene, self.goal = scene, goal
        self.cost, self.effective, self.rollout_time = np.inf, 0.0, 0.0
        self.samples = self.rounds = 0
        self.pushes: Sequence | None = None
        self.predicted: Scenes | None = None
        self.terms: dict[str, float] = {}
        rest = np.zeros((1, config.horizon, 3))
        stay = np.broadcast_to(scene, (1, config.horizon, *scene.shape))
        self.rest_cost = float(self._costs(rest, stay)[0][0])

    @property
    def improves(self) -> bool:
        """Whether the best sequence so far is better than doing nothing."""
        return bool(self.cost < self.rest_cost)

    def evaluate(self, pushes: PushSequences, mean: Sequence | None) -> Sequence:
        """Roll out one round's sequences, keep the cheapest, return the next round's mean."""
        predicted = self._rollout(pushes)
        costs, terms = self._costs(pushes, predicted)
        self.samples += len(pushes)
        self.rounds += 1
        if not np.isfinite(costs).any():
            raise ModelUnavailableError(
                f"none of the model's {len(pushes)} predictions is finite; check its checkpoint"
            )
        weights = softmin_weights(costs, self.config.temperature * cost_spread(costs))
        self.effective = effective_samples(weights)
        self._keep_best(pushes, predicted, costs, terms)
        return self._update(mean, weighted_mean(pushes, weights))

    def _update(self, mean: Sequence | None, new: Sequence) -> Sequence:
        if mean is None:
            return new
        kept = self.config.smoothing
        return weighted_mean(np.stack([mean, new]), np.array([kept, 1.0 - kept]))

    def settle_on(self, pushes: Sequence) -> None:
        """Take one sequence (H, 3) as the plan, whatever was found, if the model can predict it."""
        predicted = self._rollout(pushes[None])
        costs, terms = self._costs(pushes[None], predicted)
        if np.isfinite(costs[0]):
            self.cost = np.inf
            self._keep_best(pushes[None], predicted, costs, terms)

    def _rollout(self, pushes: PushSequences) -> PredictedScenes:
        begun = perf_counter()
        predicted = self.model.rollout(self.scene, pushes)
        self.rollout_time += perf_counter() - begun
        expected = (*pushes.shape[:2], *self.scene.shape)
        if predicted.shape != expected:
            raise ModelUnavailableError(
                f"the model predicted scenes of shape {predicted.shape}, not {expected}"
            )
        return predicted

    def _costs(
        self, pushes: PushSequences, predicted: PredictedScenes
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        rollout = make_rollout(self.scene, pushes, predicted, self.goal)
        terms = cost_terms(rollout, self.config.weights, self.feasibility)
        return np.asarray(total_cost(terms)), {k: np.asarray(v) for k, v in terms.items()}

    def _keep_best(
        self,
        pushes: PushSequences,
        predicted: PredictedScenes,
        costs: np.ndarray,
        terms: dict[str, np.ndarray],
    ) -> None:
        best = int(np.argmin(costs))
        if costs[best] < self.cost:
            self.cost = float(costs[best])
            self.pushes, self.predicted = pushes[best].copy(), predicted[best].copy()
            self.terms = {name: float(values[best]) for name, values in terms.items()}

    def result(self, planning_time: float) -> PlanResult:
        """Return the best sequence as the plan; a round must have run."""
        assert self.pushes is not None and self.predicted is not None
        return PlanResult(
            self.pushes,
            self.predicted,
            self.cost,
            self.rest_cost,
            self.terms,
            self.effective,
            self.samples,
            self.rounds,
            self.rollout_time,
            planning_time,
        )
