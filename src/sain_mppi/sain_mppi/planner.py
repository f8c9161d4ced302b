"""MPPI over whole pushes (paper section II-D, Algorithm 1 phase III)."""

import logging
from dataclasses import dataclass
from time import monotonic, perf_counter

import numpy as np

from sain_core.dynamics import RolloutModel
from sain_core.errors import ModelUnavailableError, NoPushError
from sain_core.feasibility import Feasibility
from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import check_scene, wrap_angle
from sain_core.types import (
    Mask,
    PredictedScenes,
    PushArray,
    Pushes,
    PushSequences,
    Scene,
    Scenes,
)
from sain_mppi.config import PlannerConfig
from sain_mppi.cost import cost_terms, make_rollout, total_cost
from sain_mppi.goal import Goal, check_goal
from sain_mppi.proposals import permitted, propose
from sain_mppi.sampling import Sequence, shift, uniform_sequences, weighted_mean
from sain_mppi.weights import cost_spread, effective_samples, softmin_weights

logger = logging.getLogger(__name__)

REFUSED_NEARBY = np.array([0.15, 0.15, 0.02])  # [rad, rad, m], too like a refused push to try


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


class Planner:
    """Samples push sequences, rolls them out through a model and picks what to push first."""

    def __init__(
        self,
        model: RolloutModel,
        config: PlannerConfig | None = None,
        feasibility: Feasibility | None = None,
    ) -> None:
        """Plan with this model, for an arm that can do what `feasibility` says."""
        self.model = model
        self.config = config or PlannerConfig()
        self.feasibility = feasibility or Feasibility()
        self.reset()

    def reset(self) -> None:
        """Forget the last plan and the refused pushes."""
        self._last: Sequence | None = None
        self._last_goal: Goal | None = None
        self._refused: list[PushArray] = []

    def refuse(self, push: PushArray) -> None:
        """Take note that the last plan's push was refused: do not try its like from this scene."""
        self._refused.append(np.array(push))
        self._last = None

    def plan(
        self,
        scene: Scene,
        goal: Goal,
        generator: np.random.Generator,
        deadline: float | None = None,
    ) -> PlanResult:
        """Plan from a settled scene (N, 8) towards a goal (2,) for the target.

        The next call takes it that the first push was executed, and starts from the others,
        unless `refuse` or `reset` say otherwise.

        Args:
            scene: as observed.
            goal: on the table.
            generator: the same state gives the same plan, as long as no deadline cuts it short.
            deadline: `time.monotonic` after which no further round starts.

        Raises:
            InvalidInputError: a scene or goal that cannot exist.
            OffTableError: the goal, or a disk, is not on the table.
            NoPushError: no push that moves the mid disk is permitted.
            ModelUnavailableError: nothing that the model predicted is finite.
        """
        started = perf_counter()
        check_scene(scene, self.feasibility.table)
        check_goal(goal, self.feasibility.table)
        search = _Search(self, scene, goal)
        mean = self._warm_start(goal)
        for round_number in range(self.config.rounds + self.config.stuck_rounds):
            stuck = round_number >= self.config.rounds
            late = deadline is not None and monotonic() > deadline
            if round_number and (late or (stuck and search.improves)):
                break
            pushes = self._sample(scene, goal, mean, 0 if stuck else round_number, generator)
            mean = search.evaluate(pushes, mean)
        if self.config.selection == "mean":
            search.consider_mean(mean)
        result = search.result(perf_counter() - started)
        self._last, self._last_goal, self._refused = result.pushes, goal.copy(), []
        return result

    def _warm_start(self, goal: Goal) -> Sequence | None:
        if self._last is None or not np.array_equal(goal, self._last_goal):
            return None
        return shift(self._last)

    def _sample(
        self,
        scene: Scene,
        goal: Goal,
        mean: Sequence | None,
        round_number: int,
        generator: np.random.Generator,
    ) -> PushSequences:
        """Draw up to K sequences whose first push can be carried out, the mean among them."""
        config = self.config
        pushes = propose(scene, goal, mean, round_number, config, self.feasibility, generator)
        if mean is not None:
            pushes = np.concatenate([mean[None], pushes])
        pushes = pushes[self._permitted(scene, pushes[:, 0])]
        if len(pushes) < config.samples:  # a hard place: most proposals are blocked
            more = uniform_sequences(
                self.feasibility.limits, generator, 4 * config.samples + 256, config.horizon
            )
            pushes = np.concatenate([pushes, more[self._permitted(scene, more[:, 0])]])
        if not len(pushes):
            raise NoPushError(
                f"no push can be carried out: mid disk at ({scene[0, 0]:.3f}, {scene[0, 1]:.3f})"
                f" m, {len(self._refused)} pushes refused before; move it by hand or reset"
            )
        return np.asarray(pushes[: config.samples])

    def _permitted(self, scene: Scene, pushes: Pushes) -> Mask:
        """Tell which pushes (B, 3) can be carried out, and are unlike those that were refused."""
        ok = permitted(scene, pushes, self.feasibility)
        for refused in self._refused:
            apart = np.abs(pushes - refused)
            apart[:, LOCATION] = np.abs(wrap_angle(pushes[:, LOCATION] - refused[LOCATION]))
            ok &= (apart > REFUSED_NEARBY)[:, [LOCATION, ANGLE, LENGTH]].any(axis=1)
        return ok


class _Search:
    """The best sequence over the rounds of one plan, and what finding it took."""

    def __init__(self, planner: Planner, scene: Scene, goal: Goal) -> None:
        self.planner, self.scene, self.goal = planner, scene, goal
        self.cost, self.effective, self.rollout_time = np.inf, 0.0, 0.0
        self.samples = self.rounds = 0
        self.pushes: Sequence | None = None
        self.predicted: Scenes | None = None
        self.terms: dict[str, float] = {}
        rest = np.zeros((1, planner.config.horizon, 3))
        stay = np.broadcast_to(scene, (1, planner.config.horizon, *scene.shape))
        self.rest_cost = float(self._costs(rest, stay)[0][0])

    @property
    def improves(self) -> bool:
        return bool(self.cost < self.rest_cost)

    def evaluate(self, pushes: PushSequences, mean: Sequence | None) -> Sequence:
        """Roll out one round's sequences, keep the cheapest, return the next round's mean."""
        config = self.planner.config
        predicted = self._rollout(pushes)
        costs, terms = self._costs(pushes, predicted)
        self.samples += len(pushes)
        self.rounds += 1
        if not np.isfinite(costs).any():
            raise ModelUnavailableError(
                f"none of the model's {len(pushes)} predictions is finite; check its checkpoint"
            )
        weights = softmin_weights(costs, config.temperature * cost_spread(costs))
        self.effective = effective_samples(weights)
        self._keep_best(pushes, predicted, costs, terms)
        return self._update(mean, weighted_mean(pushes, weights))

    def _update(self, mean: Sequence | None, new: Sequence) -> Sequence:
        if mean is None:
            return new
        kept = self.planner.config.smoothing
        return weighted_mean(np.stack([mean, new]), np.array([kept, 1.0 - kept]))

    def consider_mean(self, mean: Sequence) -> None:
        """Take the weighted mean itself as the plan, where its first push is permitted."""
        if not self.planner._permitted(self.scene, mean[:1])[0]:
            logger.debug("the mean's first push is not permitted: executing the cheapest sequence")
            return
        predicted = self._rollout(mean[None])
        costs, terms = self._costs(mean[None], predicted)
        if np.isfinite(costs[0]):
            self.cost = np.inf
            self._keep_best(mean[None], predicted, costs, terms)

    def _rollout(self, pushes: PushSequences) -> PredictedScenes:
        begun = perf_counter()
        predicted = self.planner.model.rollout(self.scene, pushes)
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
        terms = cost_terms(rollout, self.planner.config.weights, self.planner.feasibility)
        return total_cost(terms), terms

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
        assert self.pushes is not None and self.predicted is not None  # a round has run
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
