"""From a settled scene and a goal to a sequence of pushes (paper section II-D)."""

from collections.abc import Sequence
from dataclasses import replace
from time import monotonic
from typing import Final

import numpy as np

from sain_core.dynamics import Dynamics, RolloutModel, as_rollout, regions_of
from sain_core.errors import NoPushError
from sain_core.feasibility import Feasibility
from sain_core.push import PUSH_SIZE
from sain_core.scene import OVERLAP_TOLERANCE, check_scene, move_apart, surface_gaps
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, check_bodies
from sain_core.types import PushArray, PushSequences, Scene
from sain_mppi.algorithms import find_algorithm
from sain_mppi.search.config import EXHAUSTIVE, PlannerConfig
from sain_mppi.search.goal import Goal, check_goal, check_in_reach
from sain_mppi.search.objective import make_objective
from sain_mppi.search.poses import PoseGoal
from sain_mppi.search.result import PlanResult
from sain_mppi.search.sampling import shift
from sain_mppi.search.search import Search

SEEN_OVERLAP: Final = 0.02  # [m], deepest that disks may seem to overlap


class Planner:
    """Rolls push sequences out through a model and picks what to push first.

    The algorithm is one of `sain_mppi.algorithms`; what they share is here: checks, and what
    the last plan leaves for the next, and pushes that were refused.
    """

    def __init__(
        self,
        model: Dynamics | RolloutModel,
        config: PlannerConfig | None = None,
        feasibility: Feasibility | None = None,
    ) -> None:
        """Plan with this model, for an arm that can do what `feasibility` says."""
        self.model = as_rollout(model)
        self.config = config or PlannerConfig()
        self.feasibility = feasibility or Feasibility()
        self.reset()

    def reset(self) -> None:
        """Forget the last plan."""
        self._elites: PushSequences = np.empty((0, self.config.horizon, PUSH_SIZE))
        self._scene: Scene | None = None  # that they begin from
        self._goal: Goal | PoseGoal | None = None
        self._ahead: PushSequences | None = None  # what was found for the next scene

    def use(self, config: PlannerConfig) -> None:
        """Plan with other settings from now on; what was prepared with the earlier ones is void."""
        if config != self.config:
            self.config, self._ahead = config, None

    def plan(
        self,
        scene: Scene,
        goal: Goal | PoseGoal,
        generator: np.random.Generator,
        deadline: float | None = None,
        wide: bool = False,
        refused: Sequence[PushArray] = (),
        bodies: Bodies = PAPER_DISKS,
        start: Scene | None = None,
        shortest: float = 0.0,
    ) -> PlanResult:
        """Plan from a settled scene (N, 8) towards a goal (2,) for the target, or poses of bodies.

        From the scene of the last plan, and for its goal, the search begins with what the last
        one found; from another scene with what follows on its first push.

        Args:
            scene: as observed.
            goal: on the table.
            generator: the same state gives the same plan, as long as no deadline cuts it short.
            deadline: `time.monotonic` at which the plan is wanted: the best one until then. One
                small batch of sequences is always rolled out. None: as the settings say.
            wide: look further about, and not where the last plan would go on.
            refused: (A,) each, pushes that were refused from this scene: nothing like them is
                planned.
            bodies: shapes and roles.
            start: (N, 8), the scene in which the goal was given; None: this one.
            shortest: [m], a first push moves its body by more: less would be lost in noise.

        Raises:
            InvalidInputError: a scene or goal that cannot exist.
            OffTableError: the goal, or a disk, is not on the table.
            UnreachableError: a goal to which the arm cannot push the target from any side.
            NoPushError: no push that moves the mid disk is permitted.
            ModelUnavailableError: nothing that the model predicted is finite.
        """
        table, first = self.feasibility.table, scene if start is None else start
        bodies = bodies.fitted(len(scene))
        if bodies.all_round:
            scene = as_disks(scene)
            check_scene(scene, table)
        else:
            check_bodies(scene, bodies, table, SEEN_OVERLAP)
        if isinstance(goal, PoseGoal):
            goal.check(scene, bodies, table)
        else:
            check_goal(goal, table)
            check_in_reach(goal, scene, self.feasibility)
        if deadline is None and self.config.deadline > 0.0:
            deadline = monotonic() + self.config.deadline
        ahead, self._ahead = self._ahead, None
        config = self.config.widened() if wide else self.config
        if wide or len(refused) or ahead is None or not self._is_same(goal):
            ahead = None
        else:
            config = config.correcting()
        objective = make_objective(goal, first, config.weights, self.feasibility, bodies)
        search = Search(
            self.model,
            config,
            self.feasibility,
            scene,
            objective,
            refused,
            deadline,
            ahead,
            shortest,
        )
        known = self._start(scene, goal, search) if ahead is None else ahead
        find_algorithm(config.algorithm)(search, known, generator)
        self._elites, self._scene = search.elites.sequences, scene.copy()
        self._goal = goal if isinstance(goal, PoseGoal) else goal.copy()
        return search.result()

    def prepare(
        self,
        scene: Scene,
        generator: np.random.Generator,
        bodies: Bodies = PAPER_DISKS,
        start: Scene | None = None,
        shortest: float = 0.0,
    ) -> None:
        """Plan from a scene (N, 8) that is expected next; the next plan only corrects this one.

        The goal is that of the last plan. Where no plan is found, the next one starts anew.
        """
        goal, config = self._goal, self.config
        if goal is None or config.algorithm == EXHAUSTIVE:
            return
        first = scene if start is None else start
        objective = make_objective(goal, first, config.weights, self.feasibility, bodies)
        search = Search(self.model, config, self.feasibility, scene, objective, shortest=shortest)
        try:
            find_algorithm(config.algorithm)(search, shift(self._elites), generator)
        except NoPushError:
            return
        self._ahead = search.elites.sequences

    def complete(self, scene: Scene, result: PlanResult) -> PlanResult:
        """Return a plan from a scene (N, 8) with the model's regions, where it can tell.

        Nothing that is to be executed depends on them: a push need not wait for this.
        """
        scene = as_disks(scene)
        regions = regions_of(self.model, scene, result.pushes[None], result.predicted[None])
        return result if regions is None else replace(result, regions=regions[0])

    def _is_same(self, goal: Goal | PoseGoal) -> bool:
        last = self._goal
        if isinstance(goal, PoseGoal) or isinstance(last, PoseGoal):
            return goal is last or (isinstance(goal, PoseGoal) and goal == last)
        return last is not None and np.array_equal(goal, last)

    def _is_last(self, scene: Scene) -> bool:
        return self._scene is not None and np.array_equal(scene, self._scene)

    def _start(self, scene: Scene, goal: Goal | PoseGoal, search: Search) -> PushSequences:
        """Return what the last plan leaves (E, H, A): nothing for another goal or horizon."""
        config, size = search.config, search.objective.push_size
        if not (config.warm_start and self._is_same(goal)):
            return np.empty((0, config.horizon, size))
        if self._elites.shape[1:] != (config.horizon, size):
            return np.empty((0, config.horizon, size))
        return self._elites if self._is_last(scene) else shift(self._elites)


def as_disks(scene: Scene) -> Scene:
    """Return an observed scene (N, 8) with disks that seem to overlap a little just touching.

    Seen from above, corners and tilted disks reach under each other, and cameras are not exact.
    Deeper than `SEEN_OVERLAP` the scene stays as it is, and is refused as one that cannot be.
    """
    if scene.ndim != 2 or not np.isfinite(scene).all():
        return scene
    deepest = -float(surface_gaps(scene).min(initial=np.inf))
    return move_apart(scene) if OVERLAP_TOLERANCE < deepest <= SEEN_OVERLAP else scene
