"""From a settled scene and a goal to a sequence of pushes (paper section II-D)."""

from collections.abc import Sequence
from dataclasses import replace
from time import monotonic
from typing import Any

import numpy as np

from sain_core.errors import NoPushError
from sain_core.goal import Goal
from sain_core.model import RolloutModel
from sain_core.push import idle_pushes
from sain_core.types import PushArray, PushSequences, Scene
from sain_mppi.algorithms import find_algorithm
from sain_mppi.algorithms.sampling import PlanResult, shift
from sain_mppi.algorithms.search import Search
from sain_mppi.config import EXHAUSTIVE, PlannerConfig
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.problem import Problem

__all__ = ["Goal", "Planner", "Problem"]


class Planner:
    """Rolls push sequences out through a model and picks what to push first.

    The algorithm is one of `sain_mppi.algorithms`. What they share is here: what the last plan
    leaves for the next.
    """

    def __init__(self, model: RolloutModel, config: PlannerConfig | None = None) -> None:
        self.model = model
        self.config = config or PlannerConfig()
        self.reset()

    def reset(self) -> None:
        """Forget the last plan."""
        self._elites: PushSequences = idle_pushes(0, self.config.horizon)
        self._scene: Scene | None = None  # that they begin from
        self._goal: Goal | None = None
        self._prepared: PushSequences | None = None  # for the scene that was expected next
        self._careful = True

    def use(self, config: PlannerConfig) -> None:
        """Plan with other settings from now on; what was prepared with the earlier ones is void."""
        if config != self.config:
            self.config, self._prepared = config, None

    def plan(
        self,
        problem: Problem,
        generator: np.random.Generator,
        deadline: float | None = None,
        wide: bool = False,
        refused: Sequence[PushArray] = (),
        shortest: float = 0.0,
        careful: bool = True,
    ) -> PlanResult:
        """Plan from a settled scene towards a goal.

        From the scene of the last plan, and for its goal, the search begins with the sequences of
        the last one; from another scene with what follows on their first push.

        Args:
            problem: scene and goal.
            generator: the same state gives the same plan, as long as no deadline cuts it short.
            deadline: `time.monotonic` at which the plan is wanted: the best one until then. One
                small batch of sequences is always rolled out. None: as the settings say.
            wide: look further about, and not where the last plan would go on.
            refused: (5,) each, pushes that were refused from this scene: nothing like them is
                planned.
            shortest: [m], a first push moves its body by more: less would be lost in noise.
            careful: correct slowly near the goal.

        Raises:
            NoPushError: no push that moves a body is permitted.
            ModelUnavailableError: nothing that the model predicted is finite.
        """
        if deadline is None and self.config.deadline > 0.0:
            deadline = monotonic() + self.config.deadline
        prepared, self._prepared = self._prepared, None
        self._careful = careful
        config = self.config.widened() if wide else self.config
        if wide or refused or prepared is None or problem.goal != self._goal:
            prepared = None
        else:
            config = config.correcting()
        search = self._search(problem, config, refused, deadline, prepared, shortest)
        start = self._start(problem, config) if prepared is None else prepared
        find_algorithm(config.algorithm)(search, search.resumed(start), generator)
        self._elites = search.elites.sequences
        self._scene, self._goal = problem.scene.copy(), problem.goal
        return search.result()

    def prepare(
        self, problem: Problem, generator: np.random.Generator, shortest: float = 0.0
    ) -> None:
        """Plan from a scene that is expected next; the next plan only corrects this one.

        The goal is that of the last plan. Where there is no push, the next plan starts anew.
        """
        config = self.config
        if self._goal is None or config.algorithm == EXHAUSTIVE:
            return
        search = self._search(problem, config, shortest=shortest)
        try:
            find_algorithm(config.algorithm)(search, search.resumed(shift(self._elites)), generator)
        except NoPushError:
            return
        self._prepared = search.elites.sequences

    def _search(self, problem: Problem, config: PlannerConfig, *about: Any, **more: Any) -> Search:
        """Return a search from the scene of a problem; with care, pushes are slow near its goal."""
        objective = Objective(problem, config.weights)
        if self._careful and objective.distance <= config.correction_within:
            config = config.slowed()
        return Search(self.model, config, objective, *about, **more)

    def complete(self, problem: Problem, result: PlanResult) -> PlanResult:
        """Return a plan with the model's regions, where it has any.

        Nothing that is to be executed depends on them: a push need not wait for this.
        """
        regions = self.model.regions(problem.scene, result.pushes[None], result.predicted[None])
        return result if regions is None else replace(result, regions=regions[0])

    def _start(self, problem: Problem, config: PlannerConfig) -> PushSequences:
        """Return what the last plan leaves (E, H, 5): nothing for another goal or horizon."""
        same = config.warm_start and problem.goal == self._goal
        if not same or self._elites.shape[1] != config.horizon:
            return idle_pushes(0, config.horizon)
        if self._scene is not None and np.array_equal(problem.scene, self._scene):
            return self._elites
        return shift(self._elites)
