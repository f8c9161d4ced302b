"""One plan's search: rolls out what an algorithm tries, costs it, and keeps the best."""

from collections.abc import Sequence
from time import perf_counter

import numpy as np

from sain_core.errors import ModelUnavailableError
from sain_core.feasibility import Feasibility
from sain_core.model import Radii, RolloutModel, check_rollout
from sain_core.push import idle_pushes
from sain_core.scene import POSITION
from sain_core.types import (
    Mask,
    PredictedScenes,
    PushArray,
    Pushes,
    PushSequences,
    Scalars,
    Scene,
)
from sain_mppi.algorithms.config import PlannerConfig
from sain_mppi.algorithms.feasible_mask import permitted
from sain_mppi.algorithms.pacing import Pacing
from sain_mppi.algorithms.result import Elites, PlanResult, Times
from sain_mppi.algorithms.weights import cost_spread, effective_samples, softmin_weights
from sain_mppi.objective.cost import total_cost
from sain_mppi.objective.objective import Objective


class Search:
    """What algorithms see: which pushes are permitted, what sequences cost, when to stop."""

    def __init__(
        self,
        model: RolloutModel,
        config: PlannerConfig,
        feasibility: Feasibility,
        scene: Scene,
        objective: Objective,
        refused: Sequence[PushArray] = (),
        deadline: float | None = None,
        known: PushSequences | None = None,
        shortest: float = 0.0,
    ) -> None:
        """Begin with nothing found, in a scene (N, 8) from which some pushes (5,) were refused.

        The plan is wanted at the deadline, a `time.monotonic`; None: whenever. `known` (E, H, 5)
        are what was found for about this scene. They are rolled out in one batch with the first
        sequences that an algorithm tries. Pushes that move their body by less than the `shortest`
        way [m] are not permitted as the first.
        """
        self.model, self.config, self.feasibility = model, config, feasibility
        self.scene, self.objective, self.refused = scene, objective, refused
        self.shortest = shortest
        self.elites = Elites(config.horizon, config.shown)
        self.effective = 0.0
        self.samples = self.rounds = 0
        self._pacing = Pacing(deadline)
        self._rollout_time = self._cost_time = 0.0
        self._began = perf_counter()
        self.rest_cost = objective.rest_cost(scene, config.horizon)
        self.known: PushSequences = idle_pushes(0, config.horizon)
        if known is not None:
            self.known = known[self.permitted(known[:, 0])]
        self._waiting = self.known

    @property
    def improves(self) -> bool:
        """Whether the best sequence so far is better than doing nothing."""
        return bool(self.elites.cost < self.rest_cost)

    @property
    def over(self) -> bool:
        """Whether there is no time left for another round."""
        return self._pacing.over

    @property
    def where(self) -> str:
        """The situation, for messages."""
        body = self.objective.pushable[0]
        x, y = self.scene[body, POSITION]
        name = f"body {body}"
        refused = f", {len(self.refused)} refused before" if self.refused else ""
        return f"from here: {name} at ({x:.3f}, {y:.3f}) m{refused}"

    def permitted(self, pushes: Pushes) -> Mask:
        """Tell which pushes (B, 5) touch their body, can be carried out, and were not refused."""
        bodies, shortest = self.objective.bodies, self.shortest
        return permitted(self.scene, pushes, self.feasibility, self.refused, bodies, shortest)

    def evaluate(self, sequences: PushSequences) -> Scalars:
        """Roll out sequences (K, H, 5) and return what they cost (K,); their first pushes must be
        permitted.

        The cost is infinite where the prediction is not finite, and where the deadline came first.

        Raises:
            ModelUnavailableError: no cost is finite, or the answer is not one to this question.
        """
        waiting, self._waiting = self._waiting, self._waiting[:0]
        every = np.concatenate([waiting, sequences]) if len(waiting) else sequences
        costs = self._try(every)[len(waiting) :]
        self.rounds += 1
        if not np.isfinite(costs).any():
            raise ModelUnavailableError(
                f"none of the model's {len(sequences)} predictions is finite; check its checkpoint"
            )
        self.effective = effective_samples(self.weights(costs))
        return costs

    def probe(self, sequences: PushSequences) -> Scalars:
        """Return what variants (K, H, 5) of evaluated sequences cost (K,); they are no round.

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
            self.elites.prefer(sequence[None], predicted, costs, terms)

    def result(self) -> PlanResult:
        """Return the best sequence as the plan; something must have been evaluated."""
        elites = self.elites
        total = perf_counter() - self._began
        return PlanResult(
            elites.sequences[0],
            elites.predicted,
            elites.cost,
            self.rest_cost,
            elites.terms,
            self.effective,
            self.samples,
            self.rounds,
            Times(total, self._rollout_time, self._cost_time),
            elites.shown,
        )

    def _regions(self, sequences: PushSequences, predicted: PredictedScenes) -> Radii | None:
        begun = perf_counter()
        regions = self.model.regions(self.scene, sequences, predicted)
        self._rollout_time += perf_counter() - begun
        return regions

    def _try(self, sequences: PushSequences) -> Scalars:
        costs = np.full(len(sequences), np.inf)
        for part in self._pacing.parts(len(sequences)):
            tried = sequences[part]
            predicted = self._rollout(tried)
            costs[part], terms = self._costs(tried, predicted)
            self.elites.add(tried, predicted, costs[part], terms)
            self.samples += len(tried)
        return costs

    def _rollout(self, sequences: PushSequences) -> PredictedScenes:
        begun = perf_counter()
        predicted = self.model.rollout(self.scene, sequences)
        self._rollout_time += perf_counter() - begun
        return check_rollout(predicted, self.scene, sequences, finite=False)

    def _costs(
        self, sequences: PushSequences, predicted: PredictedScenes
    ) -> tuple[Scalars, dict[str, Scalars]]:
        regions = self._regions(sequences, predicted) if self.config.weights.risk > 0.0 else None
        begun = perf_counter()
        terms = self.objective.terms(self.scene, sequences, predicted, regions)
        costs = total_cost(terms)
        self._cost_time += perf_counter() - begun
        return costs, terms
