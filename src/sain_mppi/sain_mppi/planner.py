"""From a settled scene and a goal to a sequence of pushes (paper section II-D)."""

from dataclasses import dataclass, replace
from time import monotonic

import numpy as np

from sain_core.errors import NoPushError
from sain_core.goal import Goal
from sain_core.model import RolloutModel
from sain_core.push import idle_pushes
from sain_core.types import PushSequences
from sain_mppi.algorithms import find_algorithm
from sain_mppi.algorithms.sampling import PlanResult, WarmStart, shift
from sain_mppi.algorithms.search import Search
from sain_mppi.config import EXHAUSTIVE, PlannerConfig
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.problem import Problem

__all__ = ["Goal", "Planner", "Problem", "WarmStart"]


@dataclass(frozen=True)
class Planner:
    """Rolls push sequences out through a model and picks what to push first.

    The algorithm is one of `sain_mppi.algorithms`. A plan depends on nothing but its arguments:
    what the last one leaves is given as a `WarmStart`.
    """

    model: RolloutModel  # to predict with
    config: PlannerConfig = PlannerConfig()  # settings
    careful: bool = True  # whether pushes near the goal are slow

    def plan(
        self,
        problem: Problem,
        generator: np.random.Generator,
        start: WarmStart = WarmStart(),
        deadline: float | None = None,
    ) -> PlanResult:
        """Plan from a settled scene towards a goal.

        Args:
            problem: scene and goal.
            generator: the same state gives the same plan, as long as no deadline cuts it short.
            start: what the last plan left. For its goal, the search begins with its sequences; from
                another scene with what follows on their first push. What was prepared is corrected,
                unless a push was refused.
            deadline: `time.monotonic` at which the plan is wanted: the best one until then. One
                small batch of sequences is always rolled out. None: as the settings say.

        Raises:
            NoPushError: no push that moves a body is permitted.
            ModelUnavailableError: nothing that the model predicted is finite.
        """
        config, prepared = self.config, start.prepared_for(problem.goal, bool(problem.refused))
        if deadline is None and config.deadline > 0.0:
            deadline = monotonic() + config.deadline
        if prepared is not None:
            config = config.correcting()
        search = self._search(problem, config, deadline, prepared)
        first = _resumed(problem, config, start) if prepared is None else prepared
        find_algorithm(config.algorithm)(search, search.resumed(first), generator)
        return search.result()

    def prepare(
        self, problem: Problem, generator: np.random.Generator, start: WarmStart
    ) -> WarmStart:
        """Plan from a scene that is expected next; the next plan only corrects this one.

        The goal is that of the last plan. Where there is no push, the next plan starts anew.
        """
        if self.config.algorithm == EXHAUSTIVE:
            return start
        search = self._search(problem, self.config)
        first = search.resumed(shift(start.sequences))
        try:
            find_algorithm(self.config.algorithm)(search, first, generator)
        except NoPushError:
            return start
        return replace(start, prepared=search.elites.sequences)

    def complete(self, problem: Problem, result: PlanResult) -> PlanResult:
        """Return a plan with the model's regions, where it has any.

        Nothing that is to be executed depends on them: a push need not wait for this.
        """
        regions = self.model.regions(problem.scene, result.pushes[None], result.predicted[None])
        return result if regions is None else replace(result, regions=regions[0])

    def _search(
        self,
        problem: Problem,
        config: PlannerConfig,
        deadline: float | None = None,
        prepared: PushSequences | None = None,
    ) -> Search:
        """Return a search from the scene of a problem.

        With care, pushes are slow near its goal. A body that another one hits slides on, so pushes
        for that have the first of the speeds.
        """
        objective, speeds = Objective(problem, config.weights), config.speeds
        if self.careful and objective.distance <= config.correction_within:
            speeds = (config.speed_near(problem.goal.tolerance),)
        elif problem.pushers != problem.goal.wanted:
            speeds = speeds[:1]
        limits = problem.feasibility.limits
        allowed = tuple(min(max(speed, limits.min_speed), limits.max_speed) for speed in speeds)
        return Search(self.model, replace(config, speeds=allowed), objective, deadline, prepared)


def _resumed(problem: Problem, config: PlannerConfig, start: WarmStart) -> PushSequences:
    """Return what the last plan leaves (E, H, 5): nothing for another goal or horizon."""
    same = config.warm_start and problem.goal == start.goal
    if not same or start.sequences.shape[1] != config.horizon:
        return idle_pushes(0, config.horizon)
    if start.scene is not None and np.array_equal(problem.scene, start.scene):
        return start.sequences
    return shift(start.sequences)
