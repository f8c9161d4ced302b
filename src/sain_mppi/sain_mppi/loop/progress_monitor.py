"""Push after push towards one goal: plans, looks how they come out, and plans wider or gives up."""

from dataclasses import replace

import numpy as np

from sain_core.errors import NoProgressError
from sain_core.scene import target_distance
from sain_core.types import PushArray, Scene
from sain_mppi.planner import Planner
from sain_mppi.search.cost import resting_cost
from sain_mppi.search.goal import Goal
from sain_mppi.search.progress import Progress
from sain_mppi.search.result import PlanResult


class Replanner:
    """A planner that takes note of what its last push led to."""

    def __init__(self, planner: Planner) -> None:
        """Watch over this planner, whose settings say how."""
        self.planner = planner
        self.reset()

    def reset(self) -> None:
        """Forget the last plan and how pushes came out."""
        self.planner.reset()
        self._goal: Goal | None = None
        self._progress = Progress(self.planner.config.progress)

    def refuse(self, push: PushArray) -> None:
        """Take note that the last plan's push was refused: nothing has moved."""
        self.planner.refuse(push)

    def plan(
        self,
        scene: Scene,
        goal: Goal,
        generator: np.random.Generator,
        deadline: float | None = None,
    ) -> PlanResult:
        """Plan as `Planner.plan` does; wider after a surprise and when nothing gets better.

        Raises:
            NoProgressError: so many pushes brought nothing that it is no use going on.
            SainError: as `Planner.plan` raises.
        """
        if self._goal is None or not np.array_equal(goal, self._goal):
            self._goal, self._progress = goal.copy(), Progress(self.planner.config.progress)
        planner, progress = self.planner, self._progress
        rest = resting_cost(scene, goal, planner.config.weights, planner.feasibility)
        progress.look(scene, rest)
        if progress.hopeless:
            left = 1e3 * float(target_distance(scene, goal))
            raise NoProgressError(
                f"{progress.without} pushes in a row brought nothing, the target is {left:.0f} mm"
                " from the goal; choose another goal, move a disk, or send the goal again"
            )
        result = planner.plan(scene, goal, generator, deadline, progress.concern)
        progress.expect(scene, result.predicted[0])
        return replace(result, last=progress.last)

    def complete(self, scene: Scene, result: PlanResult) -> PlanResult:
        """Return the plan just made with the model's regions; its push need not wait for this.

        An error within them will be no surprise.
        """
        result = self.planner.complete(scene, result)
        if result.regions is not None:
            self._progress.expect(scene, result.predicted[0], result.regions[0])
        return result
