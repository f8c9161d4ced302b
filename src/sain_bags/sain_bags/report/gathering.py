"""What a bag tells of its episodes, read in one pass: the episodes, and the scenes to show."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sain_bags.reading.reader import Bag
from sain_bags.report.frames import Frame, Frames
from sain_bags.report.titles import EpisodePart
from sain_bags.rows.episodes import FIELDS, Episode, read_episodes
from sain_bags.rows.topics import PUSH_RESULT, SCENE, namespaces, topics_of
from sain_core.errors import ConfigError
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import Shape
from sain_core.shapes.solids import DISK

Progress = Callable[[], object]


@dataclass(frozen=True)
class Limits:
    """How much of a recording a page can hold."""

    frames: int = 600  # scenes in motion, in one episode
    episodes: int = 200  # with their scenes; the others only with their pushes


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
    """Read the episodes of one graph, those after a restart of its simulator on their own.

    Raises:
        DatasetError: damage, or a message that makes no sense or is of another definition.
    """
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
