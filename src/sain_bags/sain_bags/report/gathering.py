"""The episodes of a bag, read in one pass: their titles, and the scenes to show of each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import FIELDS, Episode, read_episodes
from sain_bags.rows.topics import PUSH_RESULT, SCENE, namespaces, topics_of
from sain_core.errors import ConfigError, InvalidInputError
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import Shape
from sain_core.shapes.solids import DISK
from sain_core.types import Scene
from sain_core.wire import decode_disks, decode_stamp

EPISODES_KEY: Final = "episodes"  # of the custom data: what `closed_loop` calls each with a goal

Progress = Callable[[], object]


@dataclass(frozen=True)
class Limits:
    """How much of a recording a page can hold."""

    frames: int = 600  # scenes in motion, in one episode
    episodes: int = 200  # with their scenes; the others only with their pushes


@dataclass(frozen=True)
class Frame:
    """All disks at one moment."""

    stamp: int  # [ns], of the observation
    log_time: int  # [ns since the epoch], received
    scene_id: int
    settled: bool
    scene: Scene  # (N, 8)


class Frames:
    """Scenes as they come. The first settled one of each scene id stays, and a settled one that
    says it again is left out; of the others every n-th stays, n doubling when they are too many.
    """

    def __init__(self, most: int) -> None:
        """Keep at most so many scenes in motion."""
        self._most, self.stride = most, 1
        self._kept: list[tuple[int | None, Frame]] = []  # None: at rest
        self._moving = 0  # of those kept
        self._rests: set[int] = set()  # scene ids
        self.in_motion = 0  # scenes recorded
        self.recorded = 0
        self.unusable = 0  # with NaN, or disks that come or go

    def add(self, message: Any, log_time: int) -> None:
        """Take the next `sain_interfaces/msg/Scene`."""
        self.recorded += 1
        if message.settled:
            if message.scene_id not in self._rests and self._keep(None, message, log_time):
                self._rests.add(message.scene_id)
            return
        if self.in_motion % self.stride == 0 and self._keep(self.in_motion, message, log_time):
            self._moving += 1
            if self._moving > self._most:
                self._thin()
        self.in_motion += 1

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Those that are kept, in the order they came."""
        return tuple(frame for _, frame in self._kept)

    def _keep(self, number: int | None, message: Any, log_time: int) -> bool:
        try:
            scene = decode_disks(message.disks)
        except InvalidInputError:
            self.unusable += 1
            return False
        if self._kept and scene.shape != self._kept[0][1].scene.shape:
            self.unusable += 1
            return False
        time = decode_stamp(message.header.stamp)
        frame = Frame(time, log_time, message.scene_id, bool(message.settled), scene)
        self._kept.append((number, frame))
        return True

    def _thin(self) -> None:
        self.stride *= 2
        self._kept = [
            (number, frame)
            for number, frame in self._kept
            if number is None or number % self.stride == 0
        ]
        self._moving = sum(number is not None for number, _ in self._kept)


class EpisodePart(NamedTuple):
    """An episode of a graph, or the part of it towards one of its goals."""

    namespace: str
    episode_id: int
    has_goal: bool
    goal: int = 1  # number of the goal, 0: none was given yet, ...
    goals: int = 1  # ... of so many in a row


@dataclass(frozen=True)
class Gathered:
    """One episode, and what can be shown of it."""

    namespace: str
    episode: Episode
    shown: Frames
    goal: int = 1  # number of the goal, ...
    goals: int = 1  # ... of so many in a row; each is gathered on its own; 0: none yet
    is_part: bool = False

    def bodies(self, count: int) -> Bodies:
        """Return so many bodies: those that are stated, else disks or the shapes of the world."""
        stated = self.episode.bodies
        if not stated.are_paper_disks and len(stated) == count:
            return stated
        return Bodies(tuple(map(_shape, (*self.episode.shapes, *(DISK,) * count)[:count])))

    @property
    def part(self) -> EpisodePart:
        """Which part of which episode it is."""
        number, has_goal = self.episode.episode_id, self.episode.goal is not None
        return EpisodePart(self.namespace, number, has_goal, self.goal, self.goals)

    @property
    def idle(self) -> bool:
        """Whether nothing happened: no goal, push or decision, and no disk moved."""
        episode = self.episode
        acted = episode.goal is not None or episode.pushes or episode.plans or episode.unanswered
        return not acted and not self.shown.in_motion

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Its scenes to show, in the order they came, from the one that its goal was given in."""
        frames = self.shown.frames
        if not self.is_part:
            return frames
        first, last = self.episode.interval
        begin = max((n for n, one in enumerate(frames) if one.log_time < first), default=0)
        return tuple(frame for frame in frames[begin:] if frame.log_time <= last)


def graphs(bag: Bag) -> tuple[str, ...]:
    """Return the namespaces in which the bag has scenes, or results with scenes in them."""
    return namespaces(bag, SCENE, PUSH_RESULT)


def messages_to_read(bag: Bag) -> int:
    """Return how many messages `gather` reads, over all graphs."""
    found = {topic for name in graphs(bag) for topic in topics_of(bag, name, *FIELDS, PUSH_RESULT)}
    return sum(topic.messages for topic in bag.topics if topic.name in found)


def gather(
    bag: Bag, namespace: str, limits: Limits = Limits(), progress: Progress = lambda: None
) -> tuple[Gathered, ...]:
    """Read the episodes of one graph, those after a restart of its simulator on their own."""
    shown: dict[tuple[int, int], Frames] = {}  # by run and episode

    def show(run: int, scene: Any, log_time: int) -> None:
        key = (run, scene.episode_id)
        if key not in shown:
            shown[key] = Frames(limits.frames if len(shown) < limits.episodes else 0)
        shown[key].add(scene, log_time)

    return tuple(
        Gathered(
            namespace,
            part,
            shown.get((one.run, one.episode_id), Frames(0)),
            goal,
            one.goals,
            bool(one.parts),
        )
        for one in read_episodes(bag, namespace, show, progress)
        for goal, part in one.numbered
    )


def _shape(name: str) -> Shape:
    try:
        return get_shape(name)
    except ConfigError:  # recorded where more shapes were installed
        return get_shape(DISK)


def frame_times(frames: Sequence[Frame]) -> np.ndarray:
    """Return when each frame was [s], from the first: by their stamps where these make sense.

    A stamp that goes back, or stamps that never move, are those of a clock that nobody keeps;
    then the times of reception are taken.
    """
    for times in ([frame.stamp for frame in frames], [frame.log_time for frame in frames]):
        array = np.array(times, dtype=np.int64)
        if len(array) and array[-1] > array[0] and (np.diff(array) >= 0).all():
            return np.asarray(1e-9 * (array - array[0]))
    return np.arange(len(frames), dtype=np.float64)


def episode_titles(bag: Bag, parts: Sequence[EpisodePart]) -> list[str]:
    """Return a title for each part: graph, number, and the recording's own name."""
    count = sum(part.has_goal and part.goal == 1 for part in parts)
    names = bag.custom_data.get(EPISODES_KEY, "").split()
    rest = iter(names if len(names) == count else [""] * count)
    several = len({part.namespace for part in parts}) > 1
    titles, name = [], ""
    for part in parts:
        if part.goal <= 1:
            name = " ".join(next(rest).rsplit(":", 1)) if part.has_goal else ""
        graph = (part.namespace or "/") if several else ""
        goal = f"goal {part.goal} of {part.goals}" if part.goals > 1 else ""
        goal = goal if part.goal else "no goal yet"
        words = (graph, f"Episode {part.episode_id}", name, goal)
        titles.append(" · ".join(filter(None, words)))
    return titles
