"""What a recording states once an episode, and no result repeats: goals, bodies, the world."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.reading.bag_files import Batch
from sain_bags.reading.reader import Bag
from sain_bags.rows.message_fields import BODIES, COUNT, GOAL, PUSH_RESULT, WORLD, topics_of
from sain_bags.rows.results import naming
from sain_bags.rows.tables import TableReader
from sain_core.errors import DatasetError, SainError
from sain_core.scene import THETA, X, Y
from sain_core.shapes.bodies import MOST_BODIES, PAPER_DISKS, Bodies
from sain_core.transitions import FRICTIONS, POSED, SHAPED, Column, Columns, describe_bodies
from sain_core.wire import decode_goal
from sain_core.wire.bodies import decode_bodies

ANY_EPISODE: Final = 0  # in a goal: it holds for all
PLACE: Final = ("x", "y", "tolerance")
POSE: Final = 3  # numbers: x, y, heading
KEEP: Final = POSE + 2  # column of poses, behind the tolerances of place and heading
UNKNOWN: Final = np.full(len(FRICTIONS), np.nan)
NO_PLACE: Final = np.full((1, len(PLACE)), np.nan)  # behind all others: place -1
NO_POSES: Final = np.full((MOST_BODIES, KEEP + 1), np.nan)  # NaN: not asked
NONE: Final = -1


@dataclass(frozen=True)
class LatchedGoals:
    """Goals, in the order of their receipt."""

    episodes: ndarray  # (G,)
    times: ndarray  # (G,) [ns since the epoch], received
    places: ndarray  # (G, 3) x, y, tolerance [m]; NaN where poses are asked for
    poses: dict[int, ndarray]  # by place here: (MOST_BODIES, 6), place, tolerances, keep

    @cached_property
    def _by_episode(self) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """Return episodes and times, each once and sorted; keys of goals, sorted, and the order."""
        named, codes = np.unique(self.episodes, return_inverse=True)
        moments, ranks = np.unique(self.times, return_inverse=True)
        keys = codes * (len(moments) + 1) + ranks + 1  # by episode, then by time
        order = np.argsort(keys, kind="stable")
        return named, moments, keys[order], order

    def latest(self, episodes: ndarray, times: ndarray) -> ndarray:
        """Return the place here of the latest goal of an episode (K,) at a time; -1: none."""
        if not len(self.times):
            return np.full(len(episodes), NONE)
        named, moments, keys, order = self._by_episode
        code = np.minimum(np.searchsorted(named, episodes), len(named) - 1)
        wanted = code * (len(moments) + 1) + np.searchsorted(moments, times, side="right")
        found = order[np.searchsorted(keys, wanted, side="right") - 1]
        right = (self.episodes[found] == episodes) & (self.times[found] <= times)
        return np.where(right, found, NONE)

    def chosen(self, episodes: ndarray, times: ndarray) -> ndarray:
        """Return the place here of the goal that held at each push (K,); -1: none.

        It is the later of that of its episode and that for any episode.
        """
        own = self.latest(episodes, times)
        general = self.latest(np.full_like(episodes, ANY_EPISODE), times)
        came = np.append(self.times, NONE)  # NONE is its last
        return np.where(came[own] > came[general], own, general)


class Extras(NamedTuple):
    """Which optional columns the rows of a data set have."""

    shapes: bool = False
    poses: bool = False
    keep: bool = False
    friction: bool = False


@dataclass
class Latched:
    """The goals, bodies and worlds of one graph's episodes."""

    goals: LatchedGoals
    bodies: dict[int, Bodies]  # by episode
    worlds: dict[int, ndarray]  # (3,) frictions, by episode

    @property
    def extras(self) -> Extras:
        """The columns that its rows need."""
        poses = self.goals.poses.values()
        disks = all(bodies.are_paper_disks for bodies in self.bodies.values())
        keep = any(np.isfinite(one[:, KEEP]).any() for one in poses)
        return Extras(bool(poses) or not disks, bool(poses), keep, bool(self.worlds))

    def bodies_of(self, episode: int) -> Bodies:
        """Return the bodies of an episode, by default the paper's disks."""
        return self.bodies.get(episode, PAPER_DISKS)

    def places(self, goals: ndarray) -> ndarray:
        """Return x, y and tolerance (K, 3) [m] of goals by their places; NaN: none is asked for."""
        return np.concatenate([self.goals.places, NO_PLACE])[goals]

    def columns(self, episodes: ndarray, goals: ndarray, count: int, extras: Extras) -> Columns:
        """Return goals, and optional columns, of rows (M,) whose scenes have so many bodies."""
        places = self.places(goals)
        columns = {Column.GOAL: places[:, :2], Column.TOLERANCE: places[:, 2]}
        if extras.shapes:
            disks, ids = Bodies.disks(count), episodes.tolist()
            about = {one: describe_bodies(self.bodies.get(one, disks)) for one in set(ids)}
            columns |= {name: np.array([about[one][name] for one in ids]) for name in SHAPED}
        if extras.poses:
            asked = [self.goals.poses.get(goal, NO_POSES)[:count] for goal in goals.tolist()]
            parts = np.split(np.stack(asked), (POSE, KEEP), axis=-1)
            flat = (np.ascontiguousarray(part).reshape(len(part), -1) for part in parts)
            columns |= dict(zip(POSED if extras.keep else POSED[:-1], flat, strict=False))
        if extras.friction:
            values = np.stack([self.worlds.get(one, UNKNOWN) for one in episodes.tolist()])
            columns |= {name: values[:, place] for place, name in enumerate(FRICTIONS)}
        return {str(name): values for name, values in columns.items()}


def join_extras(latched: Sequence[Latched]) -> Extras:
    """Return the columns that the rows of several recordings need, as one data set."""
    return Extras(*(any(flags) for flags in zip(*(one.extras for one in latched), strict=True)))


class Read(NamedTuple):
    """What `read_latched` read: what is latched and, if not too large, the results beside it."""

    latched: Latched
    results: tuple[Batch, ...] | None


def read_latched(bag: Bag, namespace: str, room: int = 0) -> Read:
    """Read them of one graph; results that are met on the way are kept while there is room [bytes].

    Raises:
        DatasetError: a recording is damaged; bodies that cannot be, or that change within an
            episode; a goal of poses that cannot be.
    """
    reader = _Reader(bag)
    types = (GOAL, BODIES, WORLD, *([PUSH_RESULT] if room else []))
    topics = topics_of(bag, namespace, *types)
    kept: list[Batch] | None = [] if room else None
    results = [number for number, one in enumerate(bag.channels) if one.type == PUSH_RESULT]
    for batch in bag.batches(topics, types=types):
        is_result = np.isin(batch.channels, results)
        with naming(bag):
            reader.read(batch[~is_result])
        if kept is not None and is_result.any():
            kept.append(_close(batch[is_result]))
            kept = kept if sum(len(one.data) for one in kept) <= room else None
    return Read(reader.latched(), None if kept is None else tuple(kept))


def _close(batch: Batch) -> Batch:
    """Return messages without the data between them, where that is much."""
    return batch.compact() if 2 * int(batch.sizes.sum()) < len(batch.data) else batch


class _Reader:
    """Collects what is latched."""

    def __init__(self, bag: Bag) -> None:
        self._bag = bag
        self._tables: dict[int, TableReader] = {}
        self._goals: list[tuple[ndarray, ndarray, ndarray]] = []  # episodes, times, places
        self._poses: dict[int, ndarray] = {}
        self._bodies: dict[int, Bodies] = {}
        self._worlds: dict[int, ndarray] = {}
        self._count = 0

    def latched(self) -> Latched:
        empty = (np.empty(0, np.uint64), np.empty(0, np.int64), np.empty((0, len(PLACE))))
        episodes, times, places = map(np.concatenate, zip(empty, *self._goals, strict=True))
        return Latched(
            LatchedGoals(episodes, times, places, self._poses), self._bodies, self._worlds
        )

    def read(self, batch: Batch) -> None:
        takes = {BODIES: self._take_bodies, WORLD: self._take_world}
        try:
            for number in np.unique(batch.channels).tolist():
                part, kind = batch[batch.channels == number], self._bag.channels[number].type
                if kind == GOAL:
                    self._take_goals(number, part)
                else:
                    for message in self._messages(number, part):
                        takes[kind](message)
        except SainError as error:
            raise DatasetError(f"{self._bag.path}: {error}") from error

    def _messages(self, number: int, batch: Batch) -> Iterator[Any]:
        for start, size in zip(batch.starts.tolist(), batch.sizes.tolist(), strict=True):
            yield self._bag.decode(number, batch.data[start : start + size].tobytes())

    def _take_goals(self, number: int, batch: Batch) -> None:
        if number not in self._tables:
            fields = ("episode_id", *PLACE, f"poses{COUNT}")
            channel = self._bag.channels[number]
            self._tables[number] = TableReader(channel, self._bag.decoding, fields)
        columns = self._tables[number].read(batch).columns
        places = np.stack([columns[name] for name in PLACE], axis=-1)
        posed = columns[f"poses{COUNT}"] > 0
        places[posed] = np.nan
        for place, goal in zip(
            np.flatnonzero(posed), self._messages(number, batch[posed]), strict=True
        ):
            self._poses[self._count + int(place)] = _poses(goal)
        self._goals.append((columns["episode_id"], batch.log_times, places))
        self._count += len(places)

    def _take_bodies(self, message: Any) -> None:
        bodies, episode = decode_bodies(message), int(message.episode_id)
        first = self._bodies.setdefault(episode, bodies)
        if first != bodies:
            raise DatasetError(
                f"the bodies of episode {episode} change within it: first {_names(first)}, then"
                f" {_names(bodies)}"
            )

    def _take_world(self, message: Any) -> None:
        """Take the world of an episode; values that contradict each other are not known."""
        values = np.array([getattr(message, name) for name in FRICTIONS], dtype=np.float64)
        known = self._worlds.setdefault(int(message.episode_id), values)
        if not np.array_equal(known, values):
            self._worlds[int(message.episode_id)] = UNKNOWN


def _poses(message: Any) -> ndarray:
    goal = decode_goal(message)
    largest = max((*goal.wanted, *goal.keep))
    if largest >= MOST_BODIES:
        raise DatasetError(f"a goal is given for body {largest}; at most {MOST_BODIES}")
    poses = NO_POSES.copy()
    for pose in goal.poses:
        poses[pose.body, [X, Y, POSE]] = pose.x, pose.y, pose.tolerance
        if pose.heading is not None:
            poses[pose.body, [THETA, POSE + 1]] = pose.heading, pose.heading_tolerance
    poses[list(goal.keep), KEEP] = goal.keep_tolerance
    return poses


def _names(bodies: Bodies) -> str:
    return ", ".join(shape.name for shape in bodies.shapes)
