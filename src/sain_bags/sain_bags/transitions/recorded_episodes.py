"""Recordings as episodes: what was asked, planned, predicted, and what really happened.

Everything is paired by the ids that the messages carry; time stamps pair nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

from sain_bags.reading.reader import Bag, Received
from sain_bags.transitions.message_fields import (
    BODIES,
    EPISODE_TYPES,
    GOAL,
    PLAN,
    PREDICTION,
    PUSH_RESULT,
    SCENE,
    namespaces,
    parent_of,
)
from sain_bags.transitions.recorded_pushes import (
    PlanRecord,
    RecordedPush,
    recorded_plan,
    recorded_push,
)
from sain_core.errors import DatasetError, InvalidInputError, OutOfRangeError, SainError
from sain_core.goal import Goal, Judgement
from sain_core.scene import TARGET
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scene
from sain_core.wire import decode_disks, decode_goal
from sain_core.wire.bodies import decode_bodies
from sain_core.world import PushRecord


@dataclass(frozen=True)
class Episode:
    """From one reset to the next; where goals followed each other, its goal is the last one."""

    episode_id: int
    start: Scene  # (N, 8), as the reset left it
    final: Scene  # (N, 8), the last settled one
    goal: Goal | None  # None: none was given
    max_pushes: int  # 0: no limit
    pushes: tuple[RecordedPush, ...]
    plans: tuple[PlanRecord, ...]
    interval: tuple[int, int]  # [ns since the epoch], first and last message received
    bodies: Bodies = PAPER_DISKS
    parts: tuple["Episode", ...] = ()  # towards each goal in order, where there were several

    @property
    def by_goal(self) -> tuple["Episode", ...]:
        """The episode towards each of its goals, in order; itself where there are not several."""
        return self.parts or (self,)

    @property
    def in_a_row(self) -> int:
        """How many goals were reached before the first that was not."""
        reached = [part.success for part in self.by_goal]
        return (*reached, False).index(False)

    @property
    def aimed(self) -> int:
        """The first body that the goal is for; without a goal the target."""
        return self.goal.wanted[0] if self.goal else min(TARGET, len(self.final) - 1)

    @property
    def executed(self) -> tuple[RecordedPush, ...]:
        """The pushes that were carried out."""
        return tuple(push for push in self.pushes if push.executed)

    @property
    def records(self) -> tuple[PushRecord, ...]:
        """The records of the pushes that were executed and have both scenes."""
        return tuple(push.record for push in self.pushes if push.record is not None)

    def judge(self, scene: Scene) -> Judgement | None:
        """Judge a scene (N, 8); None: there is no goal."""
        bodies = self.bodies.fitted(len(scene))
        return None if self.goal is None else self.goal.judge(scene, self.start, bodies)

    def distance(self, scene: Scene) -> float:
        """Return the largest distance [m] of a body from its pose; NaN without a goal."""
        judged = self.judge(scene)
        return float("nan") if judged is None else judged.distance

    @property
    def success(self) -> bool:
        """Whether the last scene, which was settled, meets the goal."""
        judged = self.judge(self.final)
        return judged is not None and judged.met


@dataclass
class _Draft:
    """An episode while its messages come in."""

    scenes: list[Scene] = field(default_factory=list)
    goals: list[tuple[int, Any]] = field(default_factory=list)  # when each came [ns], in order
    bodies: Bodies = PAPER_DISKS
    results: list[Any] = field(default_factory=list)
    plans: list[PlanRecord] = field(default_factory=list)
    first: int = 0
    last: int = 0

    def saw(self, log_time: int) -> None:
        self.first = self.first or log_time
        self.last = log_time

    def answer(self, result: Any) -> None:
        """Take a result, unless it is the last one again: after a crash it may be repeated."""
        last = self.results[-1] if self.results else None
        if last is None or any(
            getter(last) != getter(result)
            for getter in map(attrgetter, ("push_id", "error_code", "after.scene_id"))
        ):
            self.results.append(result)


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
    except AttributeError as error:
        raise DatasetError(
            f"{bag.path} holds messages of another definition than this graph's: {error}"
        ) from error


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
            if draft.goals and draft.goals[-1][1].goal_id == message.goal_id:
                draft.goals.pop()  # given once more
            draft.goals.append((received.log_time, message))
        elif received.type == BODIES:
            draft.bodies = _bodies(message)
        elif received.type == PLAN:
            draft.plans.append(recorded_plan(message))
        elif received.type == PUSH_RESULT:
            draft.answer(message)
    return tuple(
        _whole(number, draft, open_goal, physics)
        for number, draft in sorted(drafts.items())
        if draft.scenes or any(result.before.disks for result in draft.results)
    )


def _whole(number: int, draft: _Draft, open_goal: Any, physics: dict[int, Any]) -> Episode:
    """Return an episode, with its parts where it had several goals."""
    goals = [goal for _, goal in draft.goals]
    whole = _episode(number, draft, goals[-1] if goals else open_goal, physics)
    if len(goals) < 2:
        return whole
    parts: list[Episode] = []
    for goal, part in zip(goals, _drafts_by_goal(draft), strict=True):
        part.scenes = [parts[-1].final if parts else whole.start]
        parts.append(_episode(number, part, goal, physics))
    return replace(whole, parts=tuple(parts))


def _drafts_by_goal(draft: _Draft) -> list[_Draft]:
    """Return what belongs to each goal; a push that nobody planned to that of the one before."""
    places = {goal.goal_id: place for place, (_, goal) in enumerate(draft.goals)}
    begins = [draft.first, *(time for time, _ in draft.goals[1:])]
    ends = [*(time - 1 for time in begins[1:]), draft.last]
    drafts = [
        _Draft(bodies=draft.bodies, first=first, last=last)
        for first, last in zip(begins, ends, strict=True)
    ]
    for plan in draft.plans:
        drafts[places.get(plan.goal_id, 0)].plans.append(plan)
    wanted = {plan.push_id: plan.goal_id for plan in draft.plans if plan.push_id}
    place = 0
    for result in draft.results:
        place = places.get(wanted.get(result.push_id, -1), place)
        drafts[place].results.append(result)
    return drafts


def _episode(number: int, draft: _Draft, goal: Any, physics: dict[int, Any]) -> Episode:
    plans = {plan.push_id: plan for plan in draft.plans if plan.push_id}
    pushes = tuple(recorded_push(result, plans, physics) for result in draft.results)
    before = [push.before for push in pushes if push.before is not None]
    after = [push.after for push in pushes if push.after is not None]
    scenes = draft.scenes or before
    return Episode(
        episode_id=number,
        start=scenes[0],
        final=(after or scenes)[-1],
        goal=_goal(goal, len(scenes[0])) if goal else None,
        max_pushes=int(goal.max_pushes) if goal else 0,
        pushes=pushes,
        plans=tuple(draft.plans),
        interval=(draft.first, draft.last),
        bodies=draft.bodies,
    )


def _goal(message: Any, count: int) -> Goal | None:
    try:
        return decode_goal(message).fitted(count)
    except OutOfRangeError:  # the planner refused it, and followed none
        return None


def _bodies(message: Any) -> Bodies:
    try:
        return decode_bodies(message)
    except SainError as error:
        raise InvalidInputError(f"shapes of episode {message.episode_id}: {error}") from error


def _choose(found: tuple[str, ...], wanted: str | None, bag: Bag) -> str:
    if not found:
        raise DatasetError(f"{bag.path} holds no scenes ({SCENE}); it is no recording of the graph")
    if wanted is None and len(found) > 1:
        raise DatasetError(f"{bag.path} holds several graphs; choose one of {', '.join(found)}")
    if wanted is not None and wanted not in found:
        raise DatasetError(f"{bag.path} holds no graph {wanted!r}; it has {', '.join(found)}")
    return found[0] if wanted is None else wanted
