"""Recordings as episodes: what was asked, planned, predicted, and what really happened.

Everything is paired by the ids that the messages carry; time stamps pair nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from sain_bags.reading.reader import Bag, Received
from sain_bags.transitions.message_fields import (
    EPISODE_TYPES,
    GOAL,
    PLAN,
    PREDICTION,
    PUSH_RESULT,
    SCENE,
    namespaces,
    parent_of,
)
from sain_core.errors import DatasetError, ErrorCode, InvalidInputError
from sain_core.push import PUSH_NAMES
from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, Table, target_distance
from sain_core.types import Points, PushArray, Pushes, Scene, Scenes
from sain_core.wire import decode_disks, decode_goal, decode_plan, decode_push


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
    pushes: Pushes  # (H, 3)
    predicted: Scenes  # (H, N, 8), the scene after each
    goal_distance: float  # [m]
    planning_time: float  # [s]


@dataclass(frozen=True)
class RecordedPush:
    """A push as a recording has it: executed, refused, or without a result."""

    push_id: int
    push: PushArray  # (3,)
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
        return PushRecord(self.push, self.before, self.predicted, self.physics, self.after, time)


@dataclass(frozen=True)
class Episode:
    """From one reset to the next."""

    episode_id: int
    start: Scene  # (N, 8), as the reset left it
    final: Scene  # (N, 8), the last settled one
    goal: Points | None  # (2,), None: none was given
    tolerance: float  # [m]
    max_pushes: int  # 0: no limit
    pushes: tuple[RecordedPush, ...]
    plans: tuple[PlanRecord, ...]
    interval: tuple[int, int]  # [ns since the epoch], first and last message received

    @property
    def executed(self) -> tuple[RecordedPush, ...]:
        """The pushes that were carried out."""
        return tuple(push for push in self.pushes if push.executed)

    @property
    def records(self) -> tuple[PushRecord, ...]:
        """The records of the pushes that were executed and have both scenes."""
        return tuple(push.record for push in self.pushes if push.record is not None)

    @property
    def final_distance(self) -> float:
        """Distance from the target to the goal at the end [m], NaN without a goal."""
        return float("nan") if self.goal is None else float(target_distance(self.final, self.goal))

    @property
    def success(self) -> bool:
        """Whether the target came to rest within the tolerance with every disk on the table."""
        on_table = bool(Table().contains(self.final[:, POSITION]).all())
        return on_table and self.final_distance <= self.tolerance


@dataclass
class _Draft:
    """An episode while its messages come in."""

    scenes: list[Scene] = field(default_factory=list)
    goal: Any = None
    results: list[Any] = field(default_factory=list)
    plans: list[PlanRecord] = field(default_factory=list)
    first: int = 0
    last: int = 0

    def saw(self, log_time: int) -> None:
        self.first = self.first or log_time
        self.last = log_time


def read_episodes(bag: Bag, namespace: str | None = None) -> tuple[Episode, ...]:
    """Read the episodes of one robot.

    Args:
        bag: a recording of the graph.
        namespace: of the graph, for example ``/sain``; needed only where a bag holds several.

    Raises:
        DatasetError: the bag holds no scenes, or those of several namespaces and none was chosen,
            or a message that makes no sense.
    """
    chosen = _choose(namespaces(bag), namespace, bag)
    topics = {t.name for t in bag.topics if t.type in EPISODE_TYPES and parent_of(t.name) == chosen}
    try:
        return collect_episodes(bag.messages(topics))
    except InvalidInputError as error:
        raise DatasetError(f"{bag.path} holds a message that makes no sense: {error}") from error


def collect_episodes(messages: Iterable[Received]) -> tuple[Episode, ...]:
    """Sort messages of one graph, in the order received, into episodes."""
    drafts: dict[int, _Draft] = {}
    physics: dict[int, Any] = {}
    open_goal: Any = None  # one that names no episode holds for all
    for received in messages:
        message = received.message
        if received.type == PREDICTION:
            physics[message.push_id] = message
            continue
        if received.type == GOAL and message.episode_id == 0:
            open_goal = message
            continue
        draft = drafts.setdefault(message.episode_id, _Draft())
        draft.saw(received.log_time)
        if received.type == SCENE and message.settled:
            draft.scenes.append(decode_disks(message.disks))
        elif received.type == GOAL:
            draft.goal = message
        elif received.type == PLAN:
            draft.plans.append(_plan(message))
        elif received.type == PUSH_RESULT:
            draft.results.append(message)
    return tuple(
        _episode(number, draft, draft.goal or open_goal, physics)
        for number, draft in sorted(drafts.items())
        if draft.scenes or any(result.before.disks for result in draft.results)
    )


def _episode(number: int, draft: _Draft, goal: Any, physics: dict[int, Any]) -> Episode:
    plans = {plan.push_id: plan for plan in draft.plans if plan.push_id}
    pushes = tuple(_push(result, plans, physics) for result in draft.results)
    before = [push.before for push in pushes if push.before is not None]
    after = [push.after for push in pushes if push.after is not None]
    scenes = draft.scenes or before
    return Episode(
        episode_id=number,
        start=scenes[0],
        final=(after or scenes)[-1],
        goal=decode_goal(goal) if goal else None,
        tolerance=float(goal.tolerance) if goal else float("nan"),
        max_pushes=int(goal.max_pushes) if goal else 0,
        pushes=pushes,
        plans=tuple(draft.plans),
        interval=(draft.first, draft.last),
    )


def _push(result: Any, plans: dict[int, PlanRecord], physics: dict[int, Any]) -> RecordedPush:
    executed = result.error_code == ErrorCode.OK
    predicted = physics.get(result.push_id)
    if predicted is not None and predicted.error_code != ErrorCode.OK:
        predicted = None
    push = result.push
    return RecordedPush(
        push_id=result.push_id,
        # One that was refused may hold anything, also NaN.
        push=decode_push(push) if executed else np.array([getattr(push, n) for n in PUSH_NAMES]),
        before=decode_disks(result.before.disks) if result.before.disks else None,
        after=decode_disks(result.after.disks) if result.after.disks else None,
        error_code=result.error_code,
        error_message=result.error_message,
        source=push.source,
        duration=result.duration,
        wall_time=result.wall_time,
        plan=plans.get(result.push_id),
        physics=None if predicted is None else decode_disks(predicted.disks),
        physics_model="" if predicted is None else predicted.model,
    )


def _plan(message: Any) -> PlanRecord:
    pushes, predicted = decode_plan(message)
    decoded: dict[str, Any] = {"pushes": pushes, "predicted": predicted}
    names = [field.name for field in fields(PlanRecord) if field.name not in decoded]
    return PlanRecord(**{name: getattr(message, name) for name in names}, **decoded)


def _choose(found: tuple[str, ...], wanted: str | None, bag: Bag) -> str:
    if not found:
        raise DatasetError(f"{bag.path} holds no scenes ({SCENE}); it is no recording of the graph")
    if wanted is None and len(found) > 1:
        raise DatasetError(f"{bag.path} holds several graphs; choose one of {', '.join(found)}")
    if wanted is not None and wanted not in found:
        raise DatasetError(f"{bag.path} holds no graph {wanted!r}; it has {', '.join(found)}")
    return found[0] if wanted is None else wanted
