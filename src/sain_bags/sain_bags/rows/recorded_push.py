"""Pushes and plans as a recording has them."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from sain_core.errors import ErrorCode
from sain_core.types import PushArray, Pushes, Scene, Scenes
from sain_core.wire import decode_plan
from sain_core.world import PushRecord


@dataclass(frozen=True)
class PlanRecord:
    """One decision of the planner."""

    plan_id: int
    push_id: int  # of the push it sent, 0: none
    status: int  # sain_interfaces/msg/Plan
    error_code: int
    error_message: str
    dynamics: str
    fallback: bool
    pushes: Pushes  # (H, 5)
    predicted: Scenes  # (H, N, 8), the scene after each
    goal_distance: float  # [m]
    planning_time: float  # [s]
    goal_id: int = 0  # that it was made for
    log_time: int = 0  # [ns since the epoch]


@dataclass(frozen=True)
class RecordedPush:
    """A push as a recording has it: executed or refused."""

    push_id: int
    push: PushArray  # (5,), whatever it holds where it was refused
    before: Scene | None  # (N, 8); None: it came before there was a scene
    after: Scene | None  # (N, 8)
    error_code: int
    error_message: str
    source: str
    duration: float  # [s] simulated
    wall_time: float  # [s]
    plan: PlanRecord | None = None
    physics: Scene | None = None  # (N, 8), f_p(s, a)
    physics_model: str = ""
    episode_id: int = 0
    scene_ids: tuple[int, int] = (0, 0)  # before and after
    stamps: tuple[int, int] = (0, 0)  # [ns] simulated, the same
    log_time: int = 0  # [ns since the epoch]

    @property
    def executed(self) -> bool:
        """Whether it was carried out; a refused push moved nothing."""
        return self.error_code == ErrorCode.OK

    @property
    def predicted(self) -> Scene | None:
        """The scene (N, 8) that the planner expected after this push."""
        if self.plan is None or not len(self.plan.predicted):
            return None
        return np.asarray(self.plan.predicted[0])

    @property
    def record(self) -> PushRecord | None:
        """The record of a push that was executed; None: it was not, or a scene is missing."""
        if not self.executed or self.before is None or self.after is None:
            return None
        time = self.plan.planning_time if self.plan else 0.0
        return PushRecord(self.push, self.before, self.after, self.predicted, self.physics, time)


def recorded_plan(message: Any, log_time: int) -> PlanRecord:
    """Return a decision of the planner, received at a time [ns since the epoch]."""
    pushes, predicted = decode_plan(message)
    decoded: dict[str, Any] = {"pushes": pushes, "predicted": predicted, "log_time": log_time}
    names = [field.name for field in fields(PlanRecord) if field.name not in decoded]
    return PlanRecord(**{name: getattr(message, name) for name in names}, **decoded)
