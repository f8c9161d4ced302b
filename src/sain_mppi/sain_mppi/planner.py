"""From a settled scene and a goal to a sequence of pushes (paper section II-D)."""

from collections.abc import Sequence
from dataclasses import replace
from time import monotonic
from typing import Final

import numpy as np

from sain_core.dynamics import RolloutModel, regions_of
from sain_core.feasibility import Feasibility
from sain_core.scene import OVERLAP_TOLERANCE, check_scene, move_apart, surface_gaps
from sain_core.types import PushArray, PushSequences, Scene
from sain_mppi.algorithms import ALGORITHMS
from sain_mppi.search.config import PlannerConfig
from sain_mppi.search.goal import Goal, check_goal, check_in_reach
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
        self._elites: PushSequences = np.empty((0, self.config.horizon, 3))
        self._scene: Scene | None = None  # that they begin from
        self._goal: Goal | None = None

    def plan(
        self,
        scene: Scene,
        goal: Goal,
        generator: np.random.Generator,
        deadline: float | None = None,
        wide: bool = False,
        refused: Sequence[PushArray] = (),
    ) -> PlanResult:
        """Plan from a settled scene (N, 8) towards a goal (2,) for the target.

        From the scene of the last plan, and for its goal, the search begins with what the last
        one found; from another scene with what follows on its first push.

        Args:
            scene: as observed.
            goal: on the table.
            generator: the same state gives the same plan, as long as no deadline cuts it short.
            deadline: `time.monotonic` at which the plan is wanted: the best one until then. One
                small batch of sequences is always rolled out. None: as the settings say.
            wide: look further about, and not where the last plan would go on.
            refused: (3,) each, pushes that were refused from this scene: nothing like them is
                planned.

        Raises:
            InvalidInputError: a scene or goal that cannot exist.
            OffTableError: the goal, or a disk, is not on the table.
            UnreachableError: a goal to which the arm cannot push the target from any side.
            NoPushError: no push that moves the mid disk is permitted.
            ModelUnavailableError: nothing that the model predicted is finite.
        """
        scene = as_disks(scene)
        check_scene(scene, self.feasibility.table)
        check_goal(goal, self.feasibility.table)
        check_in_reach(goal, scene, self.feasibility)
        if deadline is None and self.config.deadline > 0.0:
            deadline = monotonic() + self.config.deadline
        config = self.config.widened() if wide else self.config
        search = Search(self.model, config, self.feasibility, scene, goal, refused, deadline)
        ALGORITHMS[config.algorithm](search, self._start(scene, goal, config), generator)
        self._elites, self._scene, self._goal = search.elites.sequences, scene.copy(), goal.copy()
        return search.result()

    def complete(self, scene: Scene, result: PlanResult) -> PlanResult:
        """Return a plan from a scene (N, 8) with the model's regions, where it can tell.

        Nothing that is to be executed depends on them: a push need not wait for this.
        """
        scene = as_disks(scene)
        regions = regions_of(self.model, scene, result.pushes[None], result.predicted[None])
        return result if regions is None else replace(result, regions=regions[0])

    def _is_last(self, scene: Scene) -> bool:
        return self._scene is not None and np.array_equal(scene, self._scene)

    def _start(self, scene: Scene, goal: Goal, config: PlannerConfig) -> PushSequences:
        """Return what the last plan leaves (E, H, 3): nothing for another goal or horizon."""
        same_goal = self._goal is not None and np.array_equal(goal, self._goal)
        if not (config.warm_start and same_goal) or self._elites.shape[1] != config.horizon:
            return np.empty((0, config.horizon, 3))
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
