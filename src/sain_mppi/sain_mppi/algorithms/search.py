"""One plan's search: draws what an algorithm tries, rolls it out, costs it, and keeps the best."""

from collections.abc import Callable, Iterator
from time import monotonic, perf_counter
from typing import Final

import numpy as np

from sain_core.errors import ModelUnavailableError, NoPushError
from sain_core.model import RolloutModel, check_rollout
from sain_core.push import LENGTH, SPEED, idle_pushes
from sain_core.scene import POSITION
from sain_core.types import Mask, Pushes, PushSequences, Scalars
from sain_mppi.algorithms.sampling import (
    Elites,
    PlanResult,
    Times,
    Tried,
    WarmStart,
    cost_spread,
    effective_samples,
    gaussian_sequences,
    softmin_weights,
    stop_early,
)
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.cost import Objective, total_cost
from sain_mppi.objective.proposals import candidates, uniform

RESET: Final = "reset the scene: ./env ros2 run sain_bringup reset"
SURPLUS: Final = 2  # sequences drawn for each one wanted: those are dropped whose first push is
# not permitted
LAST_RESORT: Final = 256  # uniform draws in a hard place, besides four for each one wanted
FIRST_PART: Final = 64  # sequences, until it is known how long they take
PART: Final = 256
RESERVE: Final = 0.004  # [s] before the deadline, for what comes after the search

CANDIDATE_SHARE: Final = 0.25  # of informed proposals in each round
SPREAD: Final = 0.2  # smallest random factor on a sample's noise; the largest is 1

Draw = Callable[[int], PushSequences]


class Search:
    """What algorithms see: which pushes are permitted, what sequences cost, when to stop."""

    def __init__(
        self,
        model: RolloutModel,
        config: PlannerConfig,
        objective: Objective,
        deadline: float | None = None,
        prepared: PushSequences | None = None,
    ) -> None:
        """Begin without a sequence.

        The plan is wanted at the deadline, a `time.monotonic`; None: whenever. `prepared` (E, H, 5)
        was planned for about this scene. It is rolled out in one batch with the first sequences
        that an algorithm tries.
        """
        self.model, self.config, self.objective = model, config, objective
        self.scene, self.feasibility = objective.problem.scene, objective.feasibility
        self.elites = Elites(config.horizon, config.shown)
        self._costs_of_round: Scalars = np.empty(0)
        self.samples = self.rounds = 0
        self._pacing = Pacing(deadline)
        self._rollout_time = self._cost_time = 0.0
        self._began = perf_counter()
        self.rest_cost = objective.rest_cost(config.horizon)
        self.prepared = idle_pushes(0, config.horizon)
        if prepared is not None:
            self.prepared = self.resumed(prepared[self.permitted(prepared[:, 0])])
        self._waiting = self.prepared

    @property
    def improves(self) -> bool:
        """Whether the best sequence so far is better than doing nothing."""
        return bool(self.elites.cost < self.rest_cost)

    @property
    def effective(self) -> float:
        """How many equally weighted samples the last round is worth; 0: there was none."""
        costs = self._costs_of_round
        return effective_samples(self.weights(costs)) if len(costs) else 0.0

    @property
    def over(self) -> bool:
        """Whether there is no time left for another round."""
        return self._pacing.over

    @property
    def where(self) -> str:
        """The situation, for messages."""
        body = self.objective.bodies.pushable[0]
        x, y = self.scene[body, POSITION]
        count = len(self.objective.problem.refused)
        refused = f", {count} refused before" if count else ""
        return f"from here: body {body} at ({x:.3f}, {y:.3f}) m{refused}"

    def permitted(self, pushes: Pushes) -> Mask:
        """Return which pushes (B, 5) touch their body, can be carried out, and were not refused."""
        return self.objective.problem.permitted(pushes)

    def uniform(self, generator: np.random.Generator, count: int) -> PushSequences:
        """Draw sequences (count, H, 5) of any allowed pushes."""
        drawn = uniform(self.objective, generator, count, self.config.horizon)
        return self.at_speeds(drawn, generator)

    def candidates(self, generator: np.random.Generator, count: int) -> PushSequences:
        """Draw informed proposals (count, H, 5)."""
        drawn = candidates(self.objective, generator, count, self.config.horizon)
        return self.at_speeds(drawn, generator)

    def at_speeds(self, sequences: PushSequences, generator: np.random.Generator) -> PushSequences:
        """Return sequences (K, H, 5) whose pushes have one of the speeds of the settings each."""
        speeds, chosen = self.config.speeds, sequences.copy()
        drawn = len(speeds) > 1
        chosen[..., SPEED] = generator.choice(speeds, chosen.shape[:2]) if drawn else speeds[0]
        return chosen

    def resumed(self, sequences: PushSequences) -> PushSequences:
        """Return sequences (E, H, 5) of an earlier plan; where there is one speed, at that."""
        resumed = sequences.copy()
        if len(self.config.speeds) == 1:
            resumed[..., SPEED] = self.config.speeds[0]
        return resumed

    def draw_permitted(
        self, draw: Draw, count: int, generator: np.random.Generator
    ) -> PushSequences:
        """Return up to so many sequences (K, H, 5) whose first push can be carried out.

        `draw` returns about as many sequences as it is asked for, the dearest to it first. Uniform
        draws are added where most of them are blocked.

        Raises `NoPushError`: no first push is permitted.
        """
        sequences = draw(SURPLUS * count)
        sequences = sequences[self.permitted(sequences[:, 0])]
        if len(sequences) < count:
            more = self.uniform(generator, 4 * count + LAST_RESORT)
            sequences = np.concatenate([sequences, more[self.permitted(more[:, 0])]])
        if not len(sequences):
            raise NoPushError(
                f"no push can be carried out {self.where}; move a body by hand, or {RESET}"
            )
        return np.asarray(sequences[:count])

    def propose(
        self, mean: Pushes | None, round_number: int, generator: np.random.Generator, count: int
    ) -> PushSequences:
        """Draw sequences (count, H, 5) of all kinds, shuffled; behind the mean, where there is one.

        Without a mean what would be drawn about it is drawn uniformly.
        """
        config = self.config
        informed = round(count * CANDIDATE_SHARE)
        about_mean = 0 if mean is None else count - informed
        if mean is not None and round_number == 0:
            about_mean -= min(round(count * config.uniform_share), about_mean)
        drawn = self.uniform(generator, count - informed - about_mean)
        parts = [
            self.candidates(generator, informed),
            stop_early(drawn, config.stop_share, generator),
        ]
        if mean is not None:
            near = self._near(mean, round_number, generator, about_mean)
            parts.append(stop_early(near, config.stop_share, generator))
        drawn = generator.permutation(self.without_idle(np.concatenate(parts)))
        return np.asarray(drawn if mean is None else np.concatenate([mean[None], drawn]))

    def _near(
        self, mean: Pushes, round_number: int, generator: np.random.Generator, count: int
    ) -> PushSequences:
        """Draw about a mean (H, 5), or about what was prepared, each in turn."""
        about = mean
        if len(self.prepared):
            about = self.prepared[np.arange(count) % len(self.prepared)]
        deviations, limits = self.config.deviations(round_number), self.feasibility.limits
        return gaussian_sequences(about, deviations, SPREAD, limits, generator, count)

    def without_idle(self, sequences: PushSequences) -> PushSequences:
        """Make rests of pushes (K, H, 5) that would end before they touch their body."""
        sequences[..., LENGTH] *= sequences[..., LENGTH] > self.feasibility.limits.clearance
        return sequences

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
        self._costs_of_round = costs
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
        """Take one sequence (H, 5) as the plan, whatever others cost, if it can be done."""
        if not self.permitted(sequence[:1]).all():
            return
        tried = self._roll_out(sequence[None])
        if np.isfinite(tried.costs[0]):
            self.elites.prefer(tried)

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
            WarmStart(elites.sequences, self.scene.copy(), self.objective.goal),
        )

    def _try(self, sequences: PushSequences) -> Scalars:
        costs = np.full(len(sequences), np.inf)
        for part in self._pacing.parts(len(sequences)):
            tried = self._roll_out(sequences[part])
            costs[part] = tried.costs
            self.elites.add(tried)
            self.samples += len(tried.costs)
        return costs

    def _roll_out(self, sequences: PushSequences) -> Tried:
        begun = perf_counter()
        predicted = self.model.rollout(self.scene, sequences)
        ended = perf_counter()
        predicted = check_rollout(predicted, self.scene, sequences, finite=False)
        terms = self.objective.terms(sequences, predicted)
        self._rollout_time += ended - begun
        self._cost_time += perf_counter() - ended
        return Tried(sequences, predicted, total_cost(terms), terms)


class Pacing:
    """Keeps a deadline: divides what is rolled out into parts, and begins none too late.

    It measures how long sequences take, and how long an algorithm takes between its rounds.
    """

    def __init__(self, deadline: float | None) -> None:
        self._deadline = deadline
        self._pace = 0.0  # [s] a sequence, at most so far
        self._between = 0.0  # [s], longest from one round to the next
        self._idle_since = perf_counter()

    @property
    def over(self) -> bool:
        """Whether there is no time left for another round."""
        return self._late(self._between + FIRST_PART * self._pace)

    def parts(self, count: int) -> Iterator[slice]:
        """Yield parts of a round: one, or under a deadline as many as there is time for.

        The first is small, and always there: whether there is time for it, `over` tells.
        """
        self._between = max(self._between, perf_counter() - self._idle_since)
        start = 0
        while start < count:
            size = self._size(count, start)
            if start and self._late(size * self._pace):
                break
            begun = perf_counter()
            yield slice(start, start + size)
            start += size
            self._pace = max(self._pace, (perf_counter() - begun) / size)
        self._idle_since = perf_counter()

    def _size(self, count: int, start: int) -> int:
        if self._deadline is None:
            return count
        hurried = not start or self._late(PART * self._pace)
        return min(FIRST_PART if hurried else PART, count - start)

    def _late(self, needed: float) -> bool:
        """Tell whether so many seconds more are too many."""
        return self._deadline is not None and monotonic() + needed + RESERVE > self._deadline
