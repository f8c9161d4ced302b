"""What a planner has to do next: for which goal, from which scene, and when to stop.

The bookkeeping of goals, scenes and refusals; no sampling and no middleware here.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from sain_core.config import Config, option
from sain_core.errors import ErrorCode
from sain_core.scene import Table
from sain_core.types import Scene
from sain_mppi.search.goal import Goal, check_goal, check_tolerance, goal_reached

LOOK_AGAIN: Final = (ErrorCode.STALE_SCENE, ErrorCode.BUSY, ErrorCode.UNKNOWN_EPISODE)
"""Refusals that say that the scene was not the current one: the next scene to arrive is."""


@dataclass(frozen=True)
class PursuitConfig(Config):
    """How long a planner keeps trying."""

    max_refusals: int = option(
        10, "refused pushes in a row, from one scene, after which it gives up", minimum=1
    )
    answer_timeout: float = option(
        5.0,
        "a scene is planned again when its push was not answered for so long",
        unit="s",
        minimum=0.1,
        maximum=3600.0,
    )
    result_patience: float = option(
        0.5,
        "a settled scene is planned from without the result of the push before after so long",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )


@dataclass(frozen=True)
class Task:
    """A goal as it was given. Episode 0: any. No pushes: no limit."""

    goal_id: int
    episode_id: int
    goal: Goal
    tolerance: float
    max_pushes: int


@dataclass(frozen=True)
class View:
    """A scene (N, 8) as it arrived, with the names a push gives it, and when [s, monotonic]."""

    scene: Scene
    episode_id: int
    scene_id: int
    settled: bool
    received: float

    @property
    def key(self) -> tuple[int, int]:
        """What a push names the scene by."""
        return self.episode_id, self.scene_id


class Verdict(Enum):
    """What a scene means for a goal."""

    PLAN = auto()
    REACHED = auto()
    EXHAUSTED = auto()
    GIVE_UP = auto()


@dataclass(frozen=True)
class Job:
    """One scene to decide on, for one goal; the attempt counts refusals from that scene."""

    task: Task
    view: View
    attempt: int


class Pursuit:
    """Follows one goal at a time. Each settled scene is decided on once, unless it is refused."""

    def __init__(
        self,
        config: PursuitConfig,
        table: Table,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin without a goal."""
        self._config = config
        self._table = table
        self._clock = clock
        self.task: Task | None = None
        self.view: View | None = None
        self._decided: tuple[int, int] | None = None
        self._awaited: tuple[int, float] | None = None  # push id and when it was sent
        self._unanswered: set[int] = set()
        self._latest: int | None = None  # push, of the task's
        self._arrived: tuple[tuple[int, int], float] | None = None  # a settled scene, and when
        self._attempt = 0
        self.pushes = 0

    def aim(self, task: Task) -> None:
        """Follow a new goal, from scratch.

        Raises:
            SainError: a goal that cannot be served; there is none to follow then.
        """
        self.task, self.pushes, self._attempt = None, 0, 0
        self._decided, self._awaited, self._latest = None, None, None
        self._unanswered.clear()
        check_goal(task.goal, self._table)
        check_tolerance(task.tolerance)
        self.task = task

    def see(self, view: View) -> None:
        """Take note of a scene."""
        if self.view is None or view.key != self.view.key:
            self._attempt, self._awaited = 0, None
        elif self._overdue():
            self._decided, self._awaited = None, None
        if view.settled and (self._arrived is None or self._arrived[0] != view.key):
            self._arrived = (view.key, self._clock())
        self.view = view

    def next_job(self) -> Job | None:
        """Return what is to be decided now, if anything; it is not returned again."""
        task, view = self.task, self.view
        if task is None or view is None or not view.settled or view.key == self._decided:
            return None
        if task.episode_id not in (0, view.episode_id) or self._result_is_under_way():
            return None
        self._decided = view.key
        return Job(task, view, self._attempt)

    def verdict(self, job: Job) -> Verdict:
        """Tell what a job calls for."""
        if goal_reached(job.view.scene, job.task.goal, job.task.tolerance):
            return Verdict.REACHED
        if job.task.max_pushes and self.pushes >= job.task.max_pushes:
            return Verdict.EXHAUSTED
        if job.attempt >= self._config.max_refusals:
            return Verdict.GIVE_UP
        return Verdict.PLAN

    def wants(self, job: Job) -> bool:
        """Tell whether a job is still about the current goal and scene."""
        return self.task is job.task and self.view is not None and self.view.key == job.view.key

    def sent(self, push_id: int) -> None:
        """Take note that a push was sent."""
        self._awaited = (push_id, self._clock())
        self._unanswered.add(push_id)
        self._latest = push_id
        self.pushes += 1

    def answered(self, push_id: int, code: int) -> bool:
        """Take note of what became of a push; tell whether it is to be replaced by another.

        A push refused for its scene waits for the next scene to arrive, others for nothing.
        """
        if push_id not in self._unanswered:
            return False  # another planner's
        self._unanswered.discard(push_id)
        if code == ErrorCode.OK:
            return False
        self.pushes -= 1
        if self._awaited is None or self._awaited[0] != push_id:
            return False  # of a scene that is past
        self._awaited = None
        self._decided = None
        if code in LOOK_AGAIN:
            self.view = None
            return False
        self._attempt += 1
        return True

    def _result_is_under_way(self) -> bool:
        """Tell whether to wait for what became of the push that led to this scene.

        Scenes and results come on topics of their own, in any order. A plan that was made before
        the result would know one push less of the episode.
        """
        if self._arrived is None or self._latest not in self._unanswered:
            return False
        return self._clock() - self._arrived[1] < self._config.result_patience

    def _overdue(self) -> bool:
        timeout = self._config.answer_timeout
        return self._awaited is not None and self._clock() - self._awaited[1] > timeout
