"""How far an episode has come, by what the graph has told of it so far."""

import time
from collections.abc import Callable
from math import inf
from typing import Final

from sain_bringup.display import EpisodeView
from sain_core.errors import ErrorCode
from sain_core.wire import decode_disks
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_interfaces.msg import Plan, PushResult, Scene

LOST: Final = 5.0  # [s] after which what was not heard has got lost, where a process has crashed


class Progress:
    """The pushes of one episode and what became of them; shown as the news comes in.

    Attributes:
        heard_at: the time [s] of the last news that brought the goal nearer, or began it.
    """

    def __init__(self, view: EpisodeView, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin before the first goal."""
        self._view = view
        self._clock = clock
        self._case: ScenarioScene | None = None
        self._goal_id = 0
        self._last_sent = 0
        self._sent: set[int] = set()  # ids of pushes: those planned for this goal, ...
        self._answered: set[int] = set()  # ... and those with a result
        self.heard_at = clock()

    def begin(self, goal_id: int, case: ScenarioScene) -> None:
        """Follow the goal of a case, which has this id."""
        self._goal_id, self._case = goal_id, case
        self._sent.clear()
        self._last_sent = 0
        self.heard_at = self._clock()

    def on_plan(self, plan: Plan) -> None:
        """Take note of a plan for the goal; others are passed over."""
        if plan.goal_id != self._goal_id:
            return
        view = self._view
        if plan.status == Plan.PUSH:
            self._sent.add(plan.push_id)
            self._last_sent = plan.push_id
            view.planned(plan.planning_time, plan.fallback, plan.error_message)
            return
        if view.ending:  # the goal was given twice
            return
        self.heard_at = self._clock()
        if plan.status == Plan.REACHED:
            view.end(reached=True)
        elif plan.status == Plan.EXHAUSTED:
            view.end(reached=False, why=f"no pushes left of {len(self._sent)}")
        else:
            view.end(reached=False, why=plan.error_message or "the planner found no push")

    def on_result(self, result: PushResult) -> None:
        """Take note of what became of a push."""
        assert self._case is not None
        self._answered.add(result.push_id)
        self.heard_at = self._clock()
        if result.error_code == ErrorCode.OK:
            self._view.at(distance(self._case, result.after))
        else:
            self._view.refuse(result.error_message)

    def is_over(self, back_at: float) -> bool:
        """Tell whether the planner is done, and so is the last push it sent: news may overtake.

        `back_at` is when the last process came back that had crashed, as in `Supervisor`. A push
        that has no answer so long after that was carried out by a process that died before it
        told of it.
        """
        if not self._view.ending:
            return False
        before = self._clock() - LOST
        lost = -inf < back_at < before and self.heard_at < before
        return lost or self._last_sent in (0, *self._answered)


def distance(case: ScenarioScene, message: Scene) -> float:
    """Return the largest distance [m] of a body to its pose."""
    scene = decode_disks(message.disks)
    return case.goal.judge(scene, scene, case.bodies).distance
