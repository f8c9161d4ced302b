"""What a bag tells of its episodes, read in one pass: the episodes, and the scenes to show."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, Final

from sain_bags.reading.reader import Bag, Received
from sain_bags.report.frames import Frame, Frames
from sain_bags.report.titles import EpisodePart
from sain_bags.transitions.message_fields import (
    EPISODE_TYPES,
    PUSH,
    PUSH_RESULT,
    SCENE,
    WORLD,
    namespaces,
    parent_of,
)
from sain_bags.transitions.recorded_episodes import Episode, collect_episodes
from sain_core.errors import ConfigError, DatasetError, InvalidInputError
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import Shape
from sain_core.shapes.solids import DISK

Progress = Callable[[], object]
TYPES: Final = EPISODE_TYPES | {PUSH, WORLD}


@dataclass(frozen=True)
class Limits:
    """How much of a recording a page can hold."""

    frames: int = 600  # scenes in motion, in one episode
    episodes: int = 200  # with their scenes; the others only with their pushes


@dataclass
class EpisodeLog:
    """What is known of an episode beside its `Episode`."""

    frames: Frames
    scenes: dict[int, tuple[int, int]] = field(default_factory=dict)  # before, after, by push id
    stamps: dict[int, tuple[int, int]] = field(default_factory=dict)  # [ns], the same
    sent: dict[int, Any] = field(default_factory=dict)  # sain_interfaces/msg/Push, unanswered
    shapes: tuple[str, ...] = ()  # of the disks; none: unknown


@dataclass(frozen=True)
class Gathered:
    """One episode, and what can be shown of it."""

    namespace: str
    episode: Episode
    log: EpisodeLog
    goal: int = 1  # number of the goal, ...
    goals: int = 1  # ... of so many in a row; each is gathered on its own

    @property
    def sent(self) -> dict[int, Any]:
        """The pushes (sain_interfaces/msg/Push) without an answer: the last of their episode."""
        return self.log.sent if self.goal == self.goals else {}

    def bodies(self, count: int) -> Bodies:
        """Return so many bodies: those that are stated, else disks or the shapes of the world."""
        stated = self.episode.bodies
        if not stated.are_paper_disks and len(stated) == count:
            return stated
        return Bodies(tuple(map(_shape, (*self.log.shapes, *(DISK,) * count)[:count])))

    @property
    def part(self) -> EpisodePart:
        """Which part of which episode it is."""
        number, has_goal = self.episode.episode_id, self.episode.goal is not None
        return EpisodePart(self.namespace, number, has_goal, self.goal, self.goals)

    @property
    def idle(self) -> bool:
        """Whether nothing happened: no goal, push or decision, and no disk moved."""
        episode = self.episode
        acted = episode.goal is not None or episode.pushes or episode.plans or self.sent
        return not acted and not self.log.frames.in_motion

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Its scenes to show, in the order they came, from the one that its goal was given in."""
        frames = self.log.frames.frames
        if self.goals == 1:
            return frames
        first, last = self.episode.interval
        begin = max((n for n, one in enumerate(frames) if one.log_time < first), default=0)
        return tuple(frame for frame in frames[begin:] if frame.log_time <= last)


def graphs(bag: Bag) -> tuple[str, ...]:
    """Return the namespaces in which the bag has scenes, or results with scenes in them."""
    return namespaces(bag, SCENE, PUSH_RESULT)


def messages_to_read(bag: Bag) -> int:
    """Return how many messages `gather` reads, over all graphs."""
    found = graphs(bag)
    return sum(
        topic.messages
        for topic in bag.topics
        if topic.type in TYPES and parent_of(topic.name) in found
    )


def gather(
    bag: Bag, namespace: str, limits: Limits = Limits(), progress: Progress = lambda: None
) -> tuple[Gathered, ...]:
    """Read the episodes of one graph, those after a restart of its simulator on their own.

    Raises:
        DatasetError: damage, or a message that makes no sense or is of another definition.
    """
    topics = [t.name for t in bag.topics if t.type in TYPES and parent_of(t.name) == namespace]
    reader = _Reader(limits, progress)
    found: list[Gathered] = []
    try:
        messages = reader.read(bag.messages(topics))
        for run, group in groupby(messages, key=lambda _: reader.run):
            for episode in collect_episodes(one for one in group if one.type in EPISODE_TYPES):
                log = reader.log.get((run, episode.episode_id), EpisodeLog(Frames(0)))
                parts = episode.by_goal
                found += [
                    Gathered(namespace, part, log, number, len(parts))
                    for number, part in enumerate(parts, start=1)
                ]
    except InvalidInputError as error:
        raise DatasetError(f"{bag.path} holds a message that makes no sense: {error}") from error
    except AttributeError as error:
        raise DatasetError(
            f"{bag.path} holds messages of another definition than this graph's: {error}"
        ) from error
    return tuple(found)


class _Reader:
    """Notes what passes, and tells when a simulator was started anew."""

    def __init__(self, limits: Limits, progress: Progress) -> None:
        self.run = 0
        self.log: dict[tuple[int, int], EpisodeLog] = {}
        self._limits, self._progress = limits, progress
        self._last = (0, 0)  # episode and stamp [ns] of the last scene
        self._world: Any = None  # sain_interfaces/msg/WorldParameters, sent before its scenes

    def read(self, messages: Iterable[Received]) -> Iterator[Received]:
        for received in messages:
            if received.type == SCENE:
                self._scene(received.message, received.log_time)
            elif received.type == PUSH:
                push = received.message
                self._of(push.episode_id).sent.setdefault(push.push_id, push)
            elif received.type == PUSH_RESULT:
                self._result(received.message)
            elif received.type == WORLD:
                self._world = received.message
            self._progress()
            yield received

    def _scene(self, message: Any, log_time: int) -> None:
        stamp = _nanoseconds(message)
        episode, last = self._last
        self.run += message.episode_id < episode and stamp < last
        self._last = (message.episode_id, stamp)
        log = self._of(message.episode_id)
        log.frames.add(message, log_time)
        if self._world is not None and self._world.episode_id == message.episode_id:
            log.shapes = tuple(self._world.shapes)

    def _result(self, result: Any) -> None:
        log = self._of(result.episode_id)
        log.sent.pop(result.push_id, None)
        log.scenes[result.push_id] = (result.before.scene_id, result.after.scene_id)
        log.stamps[result.push_id] = (_nanoseconds(result.before), _nanoseconds(result.after))

    def _of(self, episode: int) -> EpisodeLog:
        key = (self.run, episode)
        if key not in self.log:
            room = len(self.log) < self._limits.episodes
            self.log[key] = EpisodeLog(Frames(self._limits.frames if room else 0))
        return self.log[key]


def _shape(name: str) -> Shape:
    try:
        return get_shape(name)
    except ConfigError:  # recorded where more shapes were installed
        return get_shape(DISK)


def _nanoseconds(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
