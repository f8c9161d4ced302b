"""From a settled scene and a goal to a sequence of pushes (paper section II-D)."""

from collections.abc import Sequence
from dataclasses import replace
from time import monotonic

import numpy as np

from sain_core.errors import NoPushError
from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.model import RolloutModel
from sain_core.push import idle_pushes
from sain_core.types import PushArray, PushSequences, Scene
from sain_mppi.algorithms import find_algorithm
from sain_mppi.algorithms.config import EXHAUSTIVE, PlannerConfig
from sain_mppi.algorithms.result import PlanResult
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.in_reach import check_in_reach
from sain_mppi.objective.objective import Objective
from sain_mppi.objective.problem import Problem
from sain_mppi.objective.sampling import shift

__all__ = ["Goal", "Planner", "Problem"]


class Planner:
    """Rolls push sequences out through a model and picks what to push first.

    The algorithm is one of `sain_mppi.algorithms`; what they share is here: checks, and what
    the last plan leaves for the next, and pushes that were refused.
    """

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
        """Forget the last plan."""
        self._elites: PushSequences = idle_pushes(0, self.config.horizon)
        self._scene: Scene | None = None  # that they begin from
        self._goal: Goal | None = None
        self._ahead: PushSequences | None = None  # what was found for the next scene

    def use(self, config: PlannerConfig) -> None:
        """Plan with other settings from now on; what was prepared with the earlier ones is void."""
        if config != self.config:
            self.config, self._ahead = config, None

    def plan(
        self,
        problem: Problem,
        generator: np.random.Generator,
        deadline: float | None = None,
        wide: bool = False,
        refused: Sequence[PushArray] = (),
        shortest: float = 0.0,
    ) -> PlanResult:
        """Plan from a settled scene towards a goal.

        From the scene of the last plan, and for its goal, the search begins with what the last
        one found; from another scene with what follows on its first push.

        Args:
            problem: scene and goal.
            generator: the same state gives the same plan, as long as no deadline cuts it short.
            deadline: `time.monotonic` at which the plan is wanted: the best one until then. One
                small batch of sequences is always rolled out. None: as the settings say.
            wide: look further about, and not where the last plan would go on.
            refused: (5,) each, pushes that were refused from this scene: nothing like them is
                planned.
            shortest: [m], a first push moves its body by more: less would be lost in noise.

        Raises:
            UnreachableError: a goal to which the arm cannot push a body from any side.
            NoPushError: no push that moves a body is permitted.
            ModelUnavailableError: nothing that the model predicted is finite.
        """
        scene, goal = problem.scene, problem.goal
        check_in_reach(goal, scene, problem.bodies, self.feasibility)
        if deadline is None and self.config.deadline > 0.0:
            deadline = monotonic() + self.config.deadline
        ahead, self._ahead = self._ahead, None
        config = self.config.widened() if wide else self.config
        if wide or len(refused) or ahead is None or goal != self._goal:
            ahead = None
        else:
            config = config.correcting()
        search = self._search(problem, config, refused, deadline, ahead, shortest)
        known = self._start(scene, goal, search) if ahead is None else ahead
        find_algorithm(config.algorithm)(search, known, generator)
        self._elites, self._scene = search.elites.sequences, scene.copy()
        self._goal = goal
        return search.result()

    def prepare(
        self, problem: Problem, generator: np.random.Generator, shortest: float = 0.0
    ) -> None:
        """Plan from a scene that is expected next; the next plan only corrects this one.

        The goal is that of the last plan. Where no plan is found, the next one starts anew.
        """
        config = self.config
        if self._goal is None or config.algorithm == EXHAUSTIVE:
            return
        search = self._search(problem, config, shortest=shortest)
        try:
            find_algorithm(config.algorithm)(search, shift(self._elites), generator)
        except NoPushError:
            return
        self._ahead = search.elites.sequences

    def complete(self, problem: Problem, result: PlanResult) -> PlanResult:
        """Return a plan with the model's regions, where it can tell.

        Nothing that is to be executed depends on them: a push need not wait for this.
        """
        scene = problem.scene
        regions = self.model.regions(scene, result.pushes[None], result.predicted[None])
        return result if regions is None else replace(result, regions=regions[0])

    def _search(
        self,
        problem: Problem,
        config: PlannerConfig,
        refused: Sequence[PushArray] = (),
        deadline: float | None = None,
        known: PushSequences | None = None,
        shortest: float = 0.0,
    ) -> Search:
        weights, bodies = config.weights, problem.bodies
        objective = Objective(problem.goal, problem.start, weights, self.feasibility, bodies)
        scene, about = problem.scene, (refused, deadline, known, shortest)
        return Search(self.model, config, self.feasibility, scene, objective, *about)

    def _is_last(self, scene: Scene) -> bool:
        return self._scene is not None and np.array_equal(scene, self._scene)

    def _start(self, scene: Scene, goal: Goal, search: Search) -> PushSequences:
        """Return what the last plan leaves (E, H, 5): nothing for another goal or horizon."""
        config = search.config
        if not (config.warm_start and goal == self._goal):
            return idle_pushes(0, config.horizon)
        if self._elites.shape[1] != config.horizon:
            return idle_pushes(0, config.horizon)
        return self._elites if self._is_last(scene) else shift(self._elites)
