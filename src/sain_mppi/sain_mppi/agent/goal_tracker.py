"""What a planner has to do next: for which goal, from which scene, and when to stop.

The bookkeeping of goals, scenes and refusals; no sampling and no middleware here.
"""

import time
from collections.abc import Callable
from typing import Final

from sain_core.errors import ErrorCode, GoalLostError, NoPushError
from sain_core.types import PushArray
from sain_mppi.agent.events import PlanJob, SceneObserved, Stop, StopReason, Task

LOOK_AGAIN: Final = (ErrorCode.STALE_SCENE, ErrorCode.BUSY, ErrorCode.UNKNOWN_EPISODE)
"""Refusals that say that the scene was not the current one: the next scene to arrive is."""


class GoalTracker:
    """Follows one goal at a time. Each settled scene is decided on once, unless it is refused.

    Attributes:
        task: the goal; None: there is none.
        observed: the latest scene; None: there is none.
        start: the scene that was decided on first in this session.
        session: changes with goal and episode, and after a refusal for the scene.
        pushes: sent for the goal, without refused ones.
        refused: (5,) each, pushes that were refused from this scene.
    """

    def __init__(
        self,
        max_refusals: int,
        answer_timeout: float,
        result_patience: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin without a goal; see the settings of these names in `AgentConfig`."""
        self._max_refusals, self._clock = max_refusals, clock
        self._answer_timeout, self._result_patience = answer_timeout, result_patience
        self.task: Task | None = None
        self.observed: SceneObserved | None = None
        self.start: SceneObserved | None = None
        self.session = self.pushes = 0
        self.refused: tuple[PushArray, ...] = ()
        self._why = ""  # the last of them was refused
        self._decided: tuple[int, int] | None = None
        self._awaited: tuple[int, float] | None = None  # push id and when it was sent
        self._unanswered: dict[int, PushArray] = {}
        self._latest: int | None = None  # push, of the task's
        self._arrived: tuple[tuple[int, int], float] | None = None  # a settled scene, and when

    def set_goal(self, task: Task, pushes: int = 0) -> None:
        """Follow a new goal, for which so many pushes were sent before."""
        self.task, self.pushes, self.refused, self.start = task, pushes, (), None
        self._decided, self._awaited, self._latest = None, None, None
        self._unanswered.clear()

    def observe(self, scene: SceneObserved) -> None:
        """Take note of a scene."""
        if self.observed is None or scene.key != self.observed.key:
            self.refused, self._decided, self._awaited = (), None, None
        elif self._overdue():
            self._decided, self._awaited = None, None
        if scene.settled and (self._arrived is None or self._arrived[0] != scene.key):
            self._arrived = (scene.key, self._clock())
        self.observed = scene

    def next_scene(self) -> SceneObserved | None:
        """Return the scene to be decided on now, if any; it is not returned again."""
        task, scene = self.task, self.observed
        if task is None or scene is None or not scene.settled or scene.key == self._decided:
            return None
        if task.episode_id not in (0, scene.episode_id) or self._result_is_under_way():
            return None
        self._decided, first = scene.key, self.start
        if (
            first is None
            or first.episode_id != scene.episode_id
            or len(first.scene) != len(scene.scene)
        ):
            self.start = scene
            self.session += 1
        return scene

    def stop(self, job: PlanJob) -> Stop | None:
        """Return why a job needs no decision; None: it needs one."""
        task = job.task
        if job.reached:
            return Stop(task, StopReason.REACHED, job)
        if (moved := job.moved) is not None:
            lost = GoalLostError(f"body {moved} was to be kept where it was, and was moved")
            return Stop(task, StopReason.FAILED, job, lost)
        if task.max_pushes and self.pushes >= task.max_pushes:
            return Stop(task, StopReason.EXHAUSTED, job)
        count = len(job.problem.refused)
        if count >= self._max_refusals:
            last = f", the last: {self._why}" if self._why else ""
            error = NoPushError(f"{count} pushes in a row were refused from this scene{last}")
            return Stop(task, StopReason.FAILED, job, error)
        return None

    def is_current(self, job: PlanJob) -> bool:
        """Tell whether a job is still about the current goal and scene."""
        scene = self.observed
        return self.task is job.task and scene is not None and scene.key == job.observed.key

    def sent(self, push_id: int, push: PushArray) -> None:
        """Take note that a push (5,) was sent."""
        self._awaited = (push_id, self._clock())
        self._unanswered[push_id] = push
        self._latest = push_id
        self.pushes += 1

    def ended(self, push_id: int, code: int, why: str = "") -> None:
        """Take note of what became of a push, and why it was refused.

        A push refused for its scene waits for the next scene to arrive, others for nothing.
        """
        push = self._unanswered.pop(push_id, None)
        if push is None or code == ErrorCode.OK:
            return
        self.pushes -= 1
        awaited = self._awaited is not None and self._awaited[0] == push_id
        if awaited:
            self._awaited = self._decided = None
        if awaited and code not in LOOK_AGAIN:
            self.refused, self._why = (*self.refused, push), why
            return
        self.start = None  # nothing that was planned holds any more
        if awaited:
            self.observed = None

    @property
    def awaited_push(self) -> int | None:
        """The id of the push whose result is waited for."""
        return None if self._awaited is None else self._awaited[0]

    @property
    def waits_for_rest(self) -> bool:
        """Whether a goal waits for a scene at rest, with no push of its own under way."""
        rests = self.observed is not None and self.observed.settled
        return self.task is not None and not rests and self._latest not in self._unanswered

    def _result_is_under_way(self) -> bool:
        """Tell whether to wait for what became of the push that led to this scene.

        Scenes and results come on topics of their own, in any order. A plan that was made before
        the result would lack one push of the episode.
        """
        if self._arrived is None or self._latest not in self._unanswered:
            return False
        return self._clock() - self._arrived[1] < self._result_patience

    def _overdue(self) -> bool:
        awaited = self._awaited
        return awaited is not None and self._clock() - awaited[1] > self._answer_timeout
