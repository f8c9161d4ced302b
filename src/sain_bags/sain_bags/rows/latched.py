"""What a recording states once an episode, and no result repeats: goals, bodies, the world."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.reading.reader import Bag
from sain_bags.rows.message_fields import BODIES, GOAL, WORLD, topics_of
from sain_core.errors import DatasetError, SainError
from sain_core.scene import THETA, X, Y
from sain_core.shapes.bodies import MOST_BODIES, PAPER_DISKS, Bodies
from sain_core.transitions import FRICTIONS, POSED, SHAPED, Column, Columns, describe_bodies
from sain_core.wire import check_fields, decode_goal
from sain_core.wire.bodies import decode_bodies

ANY_EPISODE: Final = 0  # in a goal: it holds for all
PLACE: Final = ("x", "y", "tolerance")
POSE: Final = 3  # numbers: x, y, heading
KEEP: Final = POSE + 2  # column of poses, behind the tolerances of place and heading
UNKNOWN: Final = np.full(len(FRICTIONS), np.nan)


class RecordedGoal(NamedTuple):
    """A goal: a place for the target, or poses."""

    place: ndarray  # (3,) x, y, tolerance [m]; NaN where poses are asked for
    poses: ndarray  # (MOST_BODIES, 6), place, tolerances and keep; NaN: not asked
    wrong: str = ""  # why it makes no sense


NO_GOAL: Final = RecordedGoal(np.full(len(PLACE), np.nan), np.full((MOST_BODIES, KEEP + 1), np.nan))


class Extras(NamedTuple):
    """Which optional columns the rows of a data set have."""

    shapes: bool = False
    poses: bool = False
    keep: bool = False
    friction: bool = False


@dataclass
class Latched:
    """The goals, bodies and worlds of one graph's episodes."""

    bodies: dict[int, Bodies] = field(default_factory=dict)  # by episode
    worlds: dict[int, ndarray] = field(default_factory=dict)  # (3,) frictions, by episode
    goals: dict[int, list[RecordedGoal]] = field(default_factory=dict)  # by episode, in order
    given: dict[int, list[int]] = field(default_factory=dict)  # when each came [ns since the epoch]

    @property
    def extras(self) -> Extras:
        """The columns that its rows need."""
        poses = [goal.poses for goals in self.goals.values() for goal in goals]
        posed = any(np.isfinite(one).any() for one in poses)
        disks = all(bodies.are_paper_disks for bodies in self.bodies.values())
        keep = any(np.isfinite(one[:, KEEP]).any() for one in poses)
        return Extras(posed or not disks, posed, keep, bool(self.worlds))

    def bodies_of(self, episode: int) -> Bodies:
        """Return the bodies of an episode, by default the paper's disks."""
        return self.bodies.get(episode, PAPER_DISKS)

    def goal_of(self, episode: int, time: int) -> RecordedGoal:
        """Return the latest goal of an episode at a time [ns since the epoch], else for any."""
        for key in (episode, ANY_EPISODE):
            if place := bisect_right(self.given.get(key, ()), time):
                return self.goals[key][place - 1]
        return NO_GOAL

    def columns(
        self, episodes: Sequence[int], goals: list[RecordedGoal], count: int, extras: Extras
    ) -> Columns:
        """Return goals, and optional columns, of rows (M,) whose scenes have so many bodies."""
        place = np.stack([goal.place for goal in goals])
        columns = {Column.GOAL: place[:, :2], Column.TOLERANCE: place[:, 2]}
        if extras.shapes:
            disks = Bodies.disks(count)
            about = {e: describe_bodies(self.bodies.get(e, disks)) for e in set(episodes)}
            columns |= {name: np.array([about[e][name] for e in episodes]) for name in SHAPED}
        if extras.poses:
            poses = np.stack([goal.poses[:count] for goal in goals])  # (M, count, 6)
            parts = np.split(poses, (POSE, KEEP), axis=-1)
            flat = (np.ascontiguousarray(part).reshape(len(part), -1) for part in parts)
            columns |= dict(zip(POSED if extras.keep else POSED[:-1], flat, strict=False))
        if extras.friction:
            values = np.stack([self.worlds.get(episode, UNKNOWN) for episode in episodes])
            columns |= {name: values[:, place] for place, name in enumerate(FRICTIONS)}
        return {str(name): values for name, values in columns.items()}


def join_extras(latched: Sequence[Latched]) -> Extras:
    """Return the columns that the rows of several recordings need, as one data set."""
    return Extras(*(any(flags) for flags in zip(*(one.extras for one in latched), strict=True)))


def read_latched(bag: Bag, namespace: str) -> Latched:
    """Read them of one graph.

    Raises:
        DatasetError: a recording is damaged; bodies that cannot be, or that change within an
            episode; a goal of poses that cannot be.
    """
    latched = Latched()
    takes = {GOAL: _take_goal, BODIES: _take_bodies, WORLD: _take_world}
    try:
        for received in bag.messages(topics_of(bag, namespace, *takes)):
            takes[received.type](latched, received.message, received.log_time)
    except SainError as error:
        raise DatasetError(f"{bag.path}: {error}") from error
    return latched


def _take_goal(latched: Latched, message: Any, time: int) -> None:
    goal = _posed(message) if len(message.poses) else _placed(message)
    latched.goals.setdefault(int(message.episode_id), []).append(goal)
    latched.given.setdefault(int(message.episode_id), []).append(time)


def _take_bodies(latched: Latched, message: Any, _: int) -> None:
    bodies, episode = decode_bodies(message), int(message.episode_id)
    first = latched.bodies.setdefault(episode, bodies)
    if first != bodies:
        raise DatasetError(
            f"the bodies of episode {episode} change within it: first {_names(first)}, then"
            f" {_names(bodies)}"
        )


def _take_world(latched: Latched, message: Any, _: int) -> None:
    """Take the world of an episode; values that contradict each other are not known."""
    values = np.array([getattr(message, name) for name in FRICTIONS], dtype=np.float64)
    known = latched.worlds.setdefault(int(message.episode_id), values)
    if not np.array_equal(known, values):
        latched.worlds[int(message.episode_id)] = UNKNOWN


def _placed(message: Any) -> RecordedGoal:
    place = np.array([getattr(message, name) for name in PLACE], dtype=np.float64)
    try:
        check_fields(place, PLACE, "goal")
    except SainError as error:
        return NO_GOAL._replace(wrong=str(error))
    return NO_GOAL._replace(place=place)


def _posed(message: Any) -> RecordedGoal:
    goal = decode_goal(message)
    largest = max((*goal.wanted, *goal.keep))
    if largest >= MOST_BODIES:
        raise DatasetError(f"a goal is given for body {largest}; at most {MOST_BODIES}")
    poses = NO_GOAL.poses.copy()
    for pose in goal.poses:
        poses[pose.body, [X, Y, POSE]] = pose.x, pose.y, pose.tolerance
        if pose.heading is not None:
            poses[pose.body, [THETA, POSE + 1]] = pose.heading, pose.heading_tolerance
    poses[list(goal.keep), KEEP] = goal.keep_tolerance
    return NO_GOAL._replace(poses=poses)


def _names(bodies: Bodies) -> str:
    return ", ".join(shape.name for shape in bodies.shapes)
