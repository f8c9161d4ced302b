"""MPPI over whole pushes (paper section II-D, Algorithm 1 phase III)."""

import logging
from time import monotonic, perf_counter

import numpy as np

from sain_core.dynamics import RolloutModel
from sain_core.errors import NoPushError
from sain_core.feasibility import Feasibility
from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import check_scene, wrap_angle
from sain_core.types import Mask, PushArray, Pushes, PushSequences, Scene
from sain_mppi.config import PlannerConfig
from sain_mppi.goal import Goal, check_goal
from sain_mppi.proposals import permitted, propose
from sain_mppi.sampling import Sequence, shift, uniform_sequences
from sain_mppi.search import PlanResult, Search

__all__ = ["PlanResult", "Planner"]

logger = logging.getLogger(__name__)

REFUSED_NEARBY = np.array([0.15, 0.15, 0.02])  # [rad, rad, m], too like a refused push to try


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
        search = Search(self.model, self.config, self.feasibility, scene, goal)
        mean = self._warm_start(goal)
        for round_number in range(self.config.rounds + self.config.stuck_rounds):
            stuck = round_number >= self.config.rounds
            late = deadline is not None and monotonic() > deadline
            if round_number and (late or (stuck and search.improves)):
                break
            pushes = self._sample(scene, goal, mean, 0 if stuck else round_number, generator)
            mean = search.evaluate(pushes, mean)
        if self.config.selection == "mean" and mean is not None:
            self._prefer_mean(search, scene, mean)
        result = search.result(perf_counter() - started)
        self._last, self._last_goal, self._refused = result.pushes, goal.copy(), []
        return result

    def _prefer_mean(self, search: Search, scene: Scene, mean: Sequence) -> None:
        if self._permitted(scene, mean[:1]).all():
            search.settle_on(mean)
        else:
            logger.debug("the mean's first push is not permitted: executing the cheapest sequence")

    def _warm_start(self, goal: Goal) -> Sequence | None:
        if self._last is None or self._last_goal is None or (goal != self._last_goal).any():
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
        count = config.samples_in(round_number)
        pushes = propose(scene, goal, mean, round_number, config, self.feasibility, generator)
        if mean is not None:
            pushes = np.concatenate([mean[None], pushes])
        pushes = pushes[self._permitted(scene, pushes[:, 0])]
        if len(pushes) < count:  # a hard place: most proposals are blocked
            more = uniform_sequences(
                self.feasibility.limits, generator, 4 * config.samples + 256, config.horizon
            )
            pushes = np.concatenate([pushes, more[self._permitted(scene, more[:, 0])]])
        if not len(pushes):
            raise NoPushError(
                f"no push can be carried out: mid disk at ({scene[0, 0]:.3f}, {scene[0, 1]:.3f})"
                f" m, {len(self._refused)} pushes refused before; move it by hand or reset"
            )
        return np.asarray(pushes[:count])

    def _permitted(self, scene: Scene, pushes: Pushes) -> Mask:
        """Tell which pushes (B, 3) can be carried out, and are unlike those that were refused."""
        ok = permitted(scene, pushes, self.feasibility)
        for refused in self._refused:
            apart = np.abs(pushes - refused)
            apart[:, LOCATION] = np.abs(wrap_angle(pushes[:, LOCATION] - refused[LOCATION]))
            ok &= (apart > REFUSED_NEARBY)[:, [LOCATION, ANGLE, LENGTH]].any(axis=1)
        return ok
