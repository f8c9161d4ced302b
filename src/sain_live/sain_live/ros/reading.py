"""A bag as a recording for the page: its messages pass once through what a graph's pass through."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any, Final

from sain_bags.bag.metadata import OWN_TYPES
from sain_bags.reading.reader import Bag, Received
from sain_bags.report.gathering import EpisodePart, Frame, episode_titles, frame_times, graphs
from sain_core.errors import DatasetError, ErrorCode
from sain_live.player import Chapter, Recording, Snapshot
from sain_live.ros.updates import StateUpdater, Take
from sain_live.state import Level, LiveState, LogLine

SHOWN: Final = (
    "bodies", "scene", "aim", "joints", "curves", "phase", "why", "pushes", "model", "engine",
    "world", "lines", "result", "plan", "learned",
)  # fmt: skip
NOTED: Final = ("scene", "goal", "plan", "push_result")
MOST: Final = 20_000  # scenes in motion of a graph that are kept
DIAGNOSTICS: Final = "/diagnostics"


@dataclass(eq=False)
class _Draft:
    """A chapter while its messages come in."""

    episode_id: int
    goal: int  # number of it in the episode
    frames: list[Frame] = field(default_factory=list)
    values: list[dict[str, Any]] = field(default_factory=list)
    rests: list[Frame] = field(default_factory=list)
    moved: bool = False

    def note(self, frame: Frame, values: dict[str, Any], rest: bool) -> None:
        if not self.frames or rest:
            self.rests.append(frame)
        self.moved |= not frame.settled or rest
        self.frames.append(frame)
        self.values.append(values)

    @property
    def aims(self) -> list[Any]:
        return [one["aim"] for one in self.values if one["aim"] is not None]

    def whole(self, title: str, arm: Any) -> Chapter:
        times, aim = frame_times(self.frames).tolist(), next(iter(self.aims), None)
        for values in self.values:  # before the goal came, an episode is on its way there, too
            values.update(arm=arm, aim=values["aim"] or aim)
        numbers = {id(frame): number for number, frame in enumerate(self.frames)}
        moments = tuple(map(Snapshot, times, self.values))
        return Chapter(title, moments, tuple(times[numbers[id(frame)]] for frame in self.rests))


def read_recording(path: Path) -> Recording:
    """Read a whole bag, each graph's episodes after those of the one before.

    Raises:
        DatasetError: damaged, or without scenes.
    """
    bag = Bag(path)
    drafts: list[_Draft] = []
    log: list[LogLine] = []
    parts, arms = [], []
    for namespace in graphs(bag):
        reader = _Reader(bag, namespace, len(log))
        found = reader.read()
        parts += [
            EpisodePart(namespace, one.episode_id, bool(one.aims), one.goal, reader.goals(one))
            for one in found
        ]
        drafts += found
        arms += [reader.state.arm] * len(found)
        log += list(reader.state.log)
    if not drafts:
        why = f": {log[0].text}" if log else "; it is no recording of the graph"
        raise DatasetError(f"{path} holds no scenes that can be shown{why}")
    titles = _unique(episode_titles(bag, parts))
    acted = [draft.moved or bool(draft.aims) for draft in drafts]
    chapters = [
        draft.whole(title, arm)
        for draft, title, arm, shown in zip(drafts, titles, arms, acted, strict=True)
        if shown or not any(acted)
    ]
    name = bag.path.resolve()
    return Recording(
        (name.parent if name.name == "bag" else name).name, tuple(chapters), tuple(log)
    )


def _unique(titles: list[str]) -> list[str]:
    """Return titles with a number behind those that were there before: of a simulator's restart."""
    before = [titles[:number].count(title) for number, title in enumerate(titles)]
    return [f"{t} ({n + 1})" if n else t for t, n in zip(titles, before, strict=True)]


class _Reader:
    """Reads the episodes of one graph."""

    def __init__(self, bag: Bag, namespace: str, lines: int) -> None:
        self.state = LiveState(log=deque(), lines=lines)
        # A topic's own type counts, where others came on it, too.
        last = sorted(bag.topics, key=lambda topic: topic.type.startswith(OWN_TYPES))
        topics = {topic.name: topic.type for topic in last}
        shapes_come = f"{namespace}/shapes" in topics
        updater = StateUpdater(self.state, lambda: shapes_come, offers_goal=False)
        self._takes = {
            name: (topic, take)
            for topic, (kind, take) in updater.handlers.items()
            for name in (topic if topic.startswith("/") else f"{namespace}/{topic}",)
            if topics.get(name) == f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
        }
        self._types = {topics[name] for name in self._takes}
        self._see = updater.handlers["scene"][1]
        self._bag = bag
        self._goals: dict[int, list[int]] = {}  # ids of those of an episode
        self._open: list[int] = []  # id of the latest that names no episode
        self._drafts: list[_Draft] = []
        scenes = sum(one.messages for one in bag.topics if one.name == f"{namespace}/scene")
        self._in_motion, self._stride = 0, max(1, ceil(scenes / MOST))  # each so many-th is kept

    def read(self) -> Sequence[_Draft]:
        for received in self._bag.messages(self._takes, self._types):
            topic, take = self._takes[received.topic]
            try:
                self._take(topic, take, received)
            except Exception as error:  # noqa: BLE001 - as in a graph, one message ends nothing
                self.state.tell(Level.FAULT, f"a message on {received.topic} is ignored: {error}")
        return self._drafts

    def goals(self, draft: _Draft) -> int:
        """Return how many goals the episode of a draft had."""
        return max(len(self._goals.get(draft.episode_id, ())), 1)

    def _take(self, topic: str, take: Take, received: Received) -> None:
        message, state, ended = received.message, self.state, False
        if topic == DIAGNOSTICS:
            for status in message.status:
                status.level = bytes([status.level])  # as rclpy has it
        elif topic == "goal":
            self._give(message)
        elif topic == "push_result" and message.error_code == ErrorCode.OK and message.after.disks:
            for scene in (message.before, message.after):
                scene.episode_id, scene.settled = message.episode_id, True
            if state.scene is None or state.scene.episode_id != message.episode_id:
                self._see(message.before)  # scenes were not recorded
                self._note(received.log_time, ended)
            self._see(message.after)
            ended = True
        take(message)
        if topic in NOTED and state.scene is not None:
            self._note(received.log_time, ended)

    def _give(self, goal: Any) -> None:
        """Count a goal of its episode; one that names none is of the episode that is shown."""
        seen, number = self.state.scene, goal.episode_id
        shown = 0 if seen is None else seen.episode_id
        goals = self._goals.setdefault(number or shown, [] if number else list(self._open))
        if goals[-1:] != [goal.goal_id]:
            goals.append(goal.goal_id)
        if not number:
            self._open = [goal.goal_id]

    def _note(self, log_time: int, ended: bool) -> None:
        """Keep what is known now; `ended`: a push has."""
        state, seen = self.state, self.state.scene
        if seen is None:
            return
        key = seen.episode_id, max(len(self._goals.get(seen.episode_id, ())), 1)
        draft = self._drafts[-1] if self._drafts else None
        if draft is None or (draft.episode_id, draft.goal) != key:
            draft = _Draft(*key)
            self._drafts.append(draft)
        self._in_motion += not seen.settled
        if not seen.settled and self._in_motion % self._stride:
            return
        last = draft.frames[-1].stamp if draft.frames else 0
        stamp = max(round(1e9 * seen.stamp), last)  # topics may overtake each other
        frame = Frame(stamp, log_time, seen.scene_id, seen.settled, seen.disks)
        draft.note(frame, {name: getattr(state, name) for name in SHOWN}, ended)
