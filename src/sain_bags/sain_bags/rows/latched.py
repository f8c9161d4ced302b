"""What a recording states once an episode, and no result repeats: goal, bodies, world."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.mcap.mcap_file import Batch
from sain_bags.reading.reader import Bag
from sain_bags.rows.tables import POSE_NAMES, MessageTable, TableReader
from sain_bags.rows.topics import BODIES, GOAL, WORLD, topics_of
from sain_core.errors import DatasetError, InvalidInputError, SainError
from sain_core.goal import Goal
from sain_core.scene import THETA, X, Y
from sain_core.shapes.bodies import MOST_BODIES, PAPER_DISKS, Bodies
from sain_core.transitions import FRICTIONS, POSED, Columns, describe_bodies
from sain_core.wire import decode_goal
from sain_core.wire.bodies import decode_bodies

FIELDS: Final = ("episode_id", "keep_tolerance", "poses", "keep")  # of a `Goal`
POSE: Final = 3  # numbers: x, y, heading
KEEP: Final = POSE + 2  # column behind the tolerances of place and heading
UNKNOWN: Final = np.full(len(FRICTIONS), np.nan)
NONE: Final = 0  # the goal that asks for nothing


class Latched:
    """Goals, bodies and worlds of one graph, as far as its recording was read."""

    def __init__(self, bag: Bag, namespace: str) -> None:
        """Begin with nothing; raises `DatasetError` where a goal lacks a field."""
        self.bodies: dict[int, Bodies] = {}  # by episode
        self.goals = Goals()
        self._bag, self._worlds = bag, dict[int, ndarray]()  # (3,) frictions, by episode
        topics = topics_of(bag, namespace, GOAL)
        self._goal_reader = TableReader(bag, topics, GOAL, FIELDS)

    def read(self, batch: Batch) -> None:
        """Take what a batch states, whatever else is in it."""
        if len(goals := self._goal_reader.of(batch)):
            self.goals.add(self._goal_reader.read(goals), goals.log_times)
        for message in self._messages(batch, BODIES):
            self._take_bodies(message)
        for message in self._messages(batch, WORLD):
            self._take_world(message)

    def bodies_of(self, episode: int) -> Bodies:
        """Return the bodies of an episode, by default the paper's disks."""
        return self.bodies.get(episode, PAPER_DISKS)

    def columns(self, episodes: ndarray, goals: ndarray, count: int) -> Columns:
        """Return goal, bodies and world of rows (M,) whose scenes have so many bodies."""
        named, place = np.unique(episodes, return_inverse=True)
        disks = Bodies.disks(count)
        about = [describe_bodies(self.bodies.get(one, disks)) for one in named.tolist()]
        worlds = np.stack([self._worlds.get(one, UNKNOWN) for one in named.tolist()])[place]
        return {
            **self.goals.columns(goals, count),
            **{str(key): np.array([one[key] for one in about])[place] for key in about[0]},
            **{str(key): worlds[:, number] for number, key in enumerate(FRICTIONS)},
        }

    def _messages(self, batch: Batch, kind: str) -> Iterator[Any]:
        channels = self._bag.channels
        found = np.isin(batch.channels, [n for n, one in enumerate(channels) if one.type == kind])
        for place in np.flatnonzero(found).tolist():
            yield self._bag.decode(int(batch.channels[place]), batch.message(place))

    def _take_bodies(self, message: Any) -> None:
        try:
            bodies, episode = decode_bodies(message), int(message.episode_id)
        except SainError as error:
            raise DatasetError(f"{self._bag.path}: {error}") from error
        first = self.bodies.setdefault(episode, bodies)
        if first != bodies:
            raise DatasetError(
                f"{self._bag.path}: the bodies of episode {episode} change within it: first"
                f" {_names(first)}, then {_names(bodies)}"
            )

    def _take_world(self, message: Any) -> None:
        """Take the world of an episode; values that contradict each other are not known."""
        values = np.array([getattr(message, name) for name in FRICTIONS], dtype=np.float64)
        known = self._worlds.setdefault(int(message.episode_id), values)
        if not np.array_equal(known, values):
            self._worlds[int(message.episode_id)] = UNKNOWN


class Goals:
    """Goals in the order of their receipt; each that asks for the same has the same number."""

    def __init__(self) -> None:
        """Begin with the goal that asks for nothing."""
        self.faults: dict[int, str] = {}  # of goals that cannot be, by number
        self._given: list[tuple[int, int, int]] = []  # episode, time, number
        self._numbers: dict[bytes, int] = {}  # of goals, by all they ask for
        self._goals: list[Goal | None] = [None]  # by number; of one that cannot be nothing is asked

    def add(self, table: MessageTable, times: ndarray) -> None:
        """Add goals that were received at these times [ns since the epoch]."""
        episodes, tolerances = (table.columns[name] for name in ("episode_id", "keep_tolerance"))
        all_poses, all_keep = (table.sequences[name] for name in ("poses", "keep"))
        about = zip(episodes.tolist(), times.tolist(), tolerances.tolist(), strict=True)
        for row, (episode, time, tolerance) in enumerate(about):
            poses, keep = all_poses.one(row), all_keep.one(row)[:, 0]
            key = np.concatenate([[len(poses), tolerance], keep, poses.ravel()]).tobytes()
            if key not in self._numbers:
                self._numbers[key] = self._define(poses, keep, tolerance)
            self._given.append((episode, time, self._numbers[key]))

    def chosen(self, episodes: ndarray, times: ndarray) -> ndarray:
        """Return the number of the goal that held at each push (K,).

        It is the later of that of its episode and that for any episode.
        """
        if not self._given:
            return np.full(len(times), NONE)
        about, given, numbers = map(np.array, zip(*self._given, strict=True))
        both = [_latest(about, given, wanted, times) for wanted in (episodes, 0 * episodes)]
        return np.append(numbers, NONE)[np.maximum(*both)]  # -1 is the last

    def columns(self, goals: ndarray, count: int) -> Columns:
        """Return the goals (M,) of scenes that have so many bodies."""
        named, place = np.unique(goals, return_inverse=True)
        asked = np.stack([_asked(self._goals[one], count) for one in named.tolist()])[place]
        parts = np.split(asked, (POSE, KEEP), axis=-1)
        flat = [np.ascontiguousarray(part).reshape(len(goals), -1) for part in parts]
        return {str(name): values for name, values in zip(POSED, flat, strict=True)}

    def _define(self, poses: ndarray, keep: ndarray, tolerance: float) -> int:
        """Add a goal that nothing asked for before; return its number."""
        number = len(self._goals)
        message = SimpleNamespace(
            poses=[
                SimpleNamespace(**dict(zip(POSE_NAMES, row, strict=True))) for row in poses.tolist()
            ],
            keep=keep.tolist(),
            keep_tolerance=tolerance,
        )
        self._goals.append(None)
        try:
            self._goals[number] = _checked(decode_goal(message))
        except SainError as error:
            self.faults[number] = str(error)
        return number


def _latest(about: ndarray, given: ndarray, episodes: ndarray, times: ndarray) -> ndarray:
    """Return the place of the latest goal of each episode (K,) at a time; -1: none."""
    count = len(given)
    every = np.concatenate([about.astype(np.uint64), episodes.astype(np.uint64)])
    order = np.lexsort((np.arange(len(every)), np.concatenate([given, times]), every))
    latest = np.maximum.accumulate(np.where(order < count, np.arange(len(order)), -1))
    goal = np.where(latest < 0, -1, order[latest])  # goals stand before pushes of their time
    goal[(goal < 0) | (every[goal] != every[order])] = -1
    found = np.empty(len(every), dtype=np.int64)
    found[order] = goal
    return found[count:]


def _checked(goal: Goal) -> Goal:
    largest = max((*goal.wanted, *goal.keep))
    if largest >= MOST_BODIES:
        raise InvalidInputError(f"a goal is given for body {largest}; at most {MOST_BODIES}")
    return goal


def _asked(goal: Goal | None, count: int) -> ndarray:
    """Return what is asked of each body (count, 6): pose, tolerances, keep; NaN: nothing."""
    asked = np.full((count, KEEP + 1), np.nan)
    if goal is None:
        return asked
    for pose in goal.fitted(count).poses:
        if pose.body < count:
            asked[pose.body, [X, Y, POSE]] = pose.x, pose.y, pose.tolerance
            if pose.heading is not None:
                asked[pose.body, [THETA, POSE + 1]] = pose.heading, pose.heading_tolerance
    kept = [body for body in goal.keep if body < count]
    asked[kept, KEEP] = goal.keep_tolerance
    return asked


def _names(bodies: Bodies) -> str:
    return ", ".join(shape.name for shape in bodies.shapes)
