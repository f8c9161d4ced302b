"""Recordings as episodes: what was asked, planned, predicted, and what really happened.

A push comes with all that is known of it. Plans belong to pushes and goals by their ids.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, Final

from sain_bags.reading.reader import Bag, Received
from sain_bags.rows.results import PlanRecord, RecordedPush, ResultReader, recorded_plan
from sain_bags.rows.tables import checked_types, number_paths
from sain_bags.rows.topics import (
    BODIES,
    GOAL,
    PLAN,
    PUSH,
    PUSH_RESULT,
    SCENE,
    STROKE,
    WORLD,
    choose_graph,
    namespaces,
    topics_of,
)
from sain_core.errors import DatasetError, InvalidInputError, OutOfRangeError, SainError
from sain_core.goal import Goal, Judgement
from sain_core.scene import TARGET
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scene
from sain_core.wire import decode_disks, decode_goal, decode_stamp
from sain_core.wire.bodies import decode_bodies
from sain_core.world import PushRecord

FIELDS: Final = {  # that are read of messages beside the results
    SCENE: (
        "episode_id", "scene_id", "settled", "header.stamp.sec", "header.stamp.nanosec", "disks",
    ),
    GOAL: ("goal_id", "episode_id", "poses", "keep", "keep_tolerance", "max_pushes"),
    PLAN: (
        "plan_id", "push_id", "episode_id", "status", "error_code", "fallback", "horizon", "disks",
        "goal_distance", "planning_time", "goal_id",
    ),
    PUSH: ("push_id", "episode_id"),
    BODIES: ("episode_id",),
    WORLD: ("episode_id",),
}  # fmt: skip

OnScene = Callable[[int, Any, int], object]  # run, sain_interfaces/msg/Scene, its log time [ns]
Progress = Callable[[], object]


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
    unanswered: int = 0  # pushes without a result
    shapes: tuple[str, ...] = ()  # of the bodies, as the simulator states them; none: unknown
    run: int = 0  # of the simulator: another one counts its episodes from 1 again

    @property
    def by_goal(self) -> tuple["Episode", ...]:
        """The episode towards each of its goals, in order; itself where there are not several.

        The first part has no goal where pushes were made before one was given.
        """
        return self.parts or (self,)

    @property
    def numbered(self) -> tuple[tuple[int, "Episode"], ...]:
        """The parts of `by_goal`, each with the number of its goal; 0: none was given yet."""
        first = int(not self.parts or self.parts[0].goal is not None)
        return tuple(enumerate(self.by_goal, start=first))

    @property
    def goals(self) -> int:
        """How many goals there were, or 1."""
        return self.numbered[-1][0]

    @property
    def in_a_row(self) -> int:
        """How many goals were reached before the first that was not."""
        reached = [part.success for goal, part in self.numbered if goal]
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
        """The pushes that were executed and have both scenes."""
        return tuple(push for push in self.executed if len(push.before) and len(push.after))

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


def read_episodes(
    bag: Bag,
    namespace: str | None = None,
    on_scene: OnScene = lambda run, message, time: None,
    progress: Progress = lambda: None,
) -> tuple[Episode, ...]:
    """Read the episodes of one robot.

    Args:
        bag: a recording of the graph.
        namespace: of the graph, for example ``/sain``; needed only where a bag holds several.
        on_scene: called for each scene, settled or not.
        progress: called for each message.

    Raises:
        DatasetError: the bag holds no scenes, or those of several namespaces and none was chosen,
            or a message that makes no sense or lacks a field.
    """
    found = namespaces(bag, SCENE, PUSH_RESULT)
    if not found:
        raise DatasetError(f"{bag.path} holds no scenes ({SCENE}); it is no recording of the graph")
    namespace = choose_graph(bag, found, namespace)
    reader = _Reader(on_scene)
    try:
        for one in _received(bag, namespace):
            reader.take(one)
            progress()
        return tuple(reader.episodes())
    except InvalidInputError as error:
        raise DatasetError(f"{bag.path} holds a message that makes no sense: {error}") from error


def _received(bag: Bag, namespace: str) -> Iterator[Received | RecordedPush]:
    """Yield the messages of one graph in the order of their receipt, results as pushes."""
    kinds = (*FIELDS, STROKE, PUSH_RESULT)
    topics = topics_of(bag, namespace, *kinds)
    for channel in bag.channels:
        if channel.topic in topics and channel.type in FIELDS:
            names = FIELDS[channel.type]
            # A plan has arrays of numbers: a scene's disks are messages.
            paths = [names] if channel.type == PLAN else map(number_paths, names)
            checked_types(bag, channel, [path for some in paths for path in some])
    reader = ResultReader(bag, namespace)
    for batch in bag.batches(topics, types=kinds):
        results = reader.results(batch)
        pushes = results.pushes() if results is not None else iter(())
        times = zip(batch.log_times.tolist(), batch.publish_times.tolist(), strict=True)
        for place, (number, moments) in enumerate(zip(batch.channels.tolist(), times, strict=True)):
            topic, kind = bag.channels[number].topic, bag.channels[number].type
            if kind == PUSH_RESULT:
                yield next(pushes)
            elif kind != STROKE:
                yield Received(topic, kind, bag.decode(number, batch.message(place)), *moments)


@dataclass
class _Draft:
    """An episode while its messages come in."""

    scenes: list[Scene] = field(default_factory=list)
    goals: list[tuple[int, Any]] = field(default_factory=list)  # when each came [ns], in order
    bodies: Bodies = PAPER_DISKS
    shapes: tuple[str, ...] = ()
    pushes: list[RecordedPush] = field(default_factory=list)
    plans: list[PlanRecord] = field(default_factory=list)
    sent: set[int] = field(default_factory=set)  # push ids
    first: int = 0
    last: int = 0

    def saw(self, log_time: int) -> None:
        self.first = self.first or log_time
        self.last = log_time

    def push(self, push: RecordedPush) -> None:
        """Take a push, unless its result is the last one again: after a crash it is repeated."""
        about = attrgetter("push_id", "code", "scene_ids")
        if not self.pushes or about(self.pushes[-1]) != about(push):
            self.pushes.append(push)

    def goal(self, message: Any, log_time: int) -> None:
        """Take a goal, unless it is the last one again: latched ones are repeated."""
        if not self.goals or not _is_same(self.goals[-1][1], message):
            self.goals.append((log_time, message))

    def end(self) -> None:
        """Drop the goals that came when nothing of this episode did any more."""
        while self.goals and self.goals[-1][0] > self.last:
            self.goals.pop()

    def place(self, log_time: int, goal_id: int | None = None) -> int:
        """Return the place of the goal that held at a time; -1: none did.

        `goal_id` is that of a plan, which may be published after the next goal came.
        """
        before = [n for n, (time, _) in enumerate(self.goals) if time <= log_time]
        named = [n for n in before if self.goals[n][1].goal_id == goal_id]
        return (named or before or [-1])[-1]


class _Reader:
    """Sorts the messages of one graph, in the order received, into episodes."""

    def __init__(self, on_scene: OnScene) -> None:
        self._on_scene = on_scene
        self._drafts: dict[tuple[int, int], _Draft] = {}  # by run and episode
        self._current: _Draft | None = None  # of the message before
        self._open_goal: tuple[int, Any] | None = None  # when it came; it names no episode
        self._world: Any = None  # sain_interfaces/msg/WorldParameters
        self._run, self._last = 0, (0, 0)  # episode and stamp [ns] of the last scene

    def take(self, one: Received | RecordedPush) -> None:
        if isinstance(one, RecordedPush):
            self._of(one.episode_id, one.log_time).push(one)
            return
        if one.type == SCENE:
            self._scene(one.message, one.log_time)
        elif one.type == PUSH:
            self._of(one.message.episode_id, None).sent.add(one.message.push_id)
        elif one.type == WORLD:
            self._world = one.message  # of an episode whose scenes are to come
        else:
            self._note(one.type, one.message, one.log_time)

    def _note(self, kind: str, message: Any, time: int) -> None:
        """Take a goal, a plan or bodies. A goal that names no episode is of the current one."""
        draft: _Draft | None
        if message.episode_id == 0 and kind in (GOAL, PLAN):
            draft = self._current
            self._open_goal = (time, message) if kind == GOAL else self._open_goal
        else:
            draft = self._of(message.episode_id, time)
        if draft is None:
            return
        if kind == GOAL:
            draft.goal(message, time)
        elif kind == BODIES:
            draft.bodies = _bodies(message)
        else:
            draft.plans.append(recorded_plan(message, time))

    def episodes(self) -> Iterator[Episode]:
        for (run, number), draft in sorted(self._drafts.items(), key=lambda item: item[0]):
            if draft.scenes or any(len(push.before) for push in draft.pushes):
                yield _whole(number, draft, run)

    def _scene(self, message: Any, time: int) -> None:
        stamp = decode_stamp(message.header.stamp)
        episode, last = self._last
        self._run += message.episode_id < episode and stamp < last  # a simulator was started anew
        self._last = (message.episode_id, stamp)
        self._on_scene(self._run, message, time)
        draft = self._of(message.episode_id, time)
        if self._world is not None and self._world.episode_id == message.episode_id:
            draft.shapes = tuple(getattr(self._world, "shapes", ()))
        if message.settled:
            draft.scenes.append(decode_disks(message.disks))

    def _of(self, episode: int, time: int | None) -> _Draft:
        key = (self._run, episode)
        if key not in self._drafts:
            if self._current is not None:
                self._current.end()
            self._drafts[key] = _Draft(goals=[self._open_goal] if self._open_goal else [])
        self._current = draft = self._drafts[key]
        if time is not None:
            draft.saw(time)
        return draft


def _whole(number: int, draft: _Draft, run: int) -> Episode:
    """Return an episode, with its parts where not one goal held for all of it."""
    drafts = _drafts_by_goal(draft)
    whole = _episode(number, draft, drafts[-1][0], run)
    if len(drafts) < 2:
        return whole
    parts: list[Episode] = []
    for goal, part in drafts:
        part.scenes = [parts[-1].final if parts else whole.start]
        parts.append(_episode(number, part, goal, run))
    return replace(whole, parts=tuple(parts))


def _drafts_by_goal(draft: _Draft) -> list[tuple[Any, _Draft]]:
    """Return each goal with what belongs to it; None: no goal was given yet."""
    goals = [(draft.first, None), *draft.goals]
    begins = [max(time, draft.first) for time, _ in goals]
    ends = [*(time - 1 for time in begins[1:]), max(begins[-1], draft.last)]
    drafts = [
        replace(draft, pushes=[], plans=[], sent=set(), first=first, last=last)
        for first, last in zip(begins, ends, strict=True)
    ]
    planned = [plan for plan in draft.plans if plan.push_id]
    places = {plan.push_id: draft.place(plan.log_time, plan.goal_id) for plan in planned}
    for plan in draft.plans:
        drafts[1 + draft.place(plan.log_time, plan.goal_id)].plans.append(plan)
    for push in draft.pushes:
        place = places.get(push.push_id, draft.place(push.log_time))
        drafts[1 + place].pushes.append(push)
    drafts[-1].sent = draft.sent - {push.push_id for push in draft.pushes}
    # What held before a goal of this episode came is a part only if something was done for it.
    early = 1 + sum(time < draft.first for time, _ in draft.goals)
    kept = [n for n, part in enumerate(drafts) if n >= early or part.pushes or part.plans]
    return [(goals[n][1], drafts[n]) for n in kept or [early - 1]]


def _is_same(goal: Any, other: Any) -> bool:
    """Tell whether a goal is another one once more, whenever it was sent."""
    return repr({**vars(goal), "header": None}) == repr({**vars(other), "header": None})


def _episode(number: int, draft: _Draft, goal: Any, run: int) -> Episode:
    plans = {plan.push_id: plan for plan in draft.plans if plan.push_id}
    pushes = tuple(push.planned(plans.get(push.push_id)) for push in draft.pushes)
    after = [push.after for push in pushes if len(push.after)]
    scenes = draft.scenes or [push.before for push in pushes if len(push.before)]
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
        unanswered=len(draft.sent - {push.push_id for push in pushes}),
        shapes=draft.shapes,
        run=run,
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
