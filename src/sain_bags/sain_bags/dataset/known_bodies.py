"""Shapes, roles and goals of poses, which scenes do not show: a recording states them apart."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.transitions.message_fields import BODIES, GOAL, GOAL_ID, parent_of
from sain_bags.transitions.sources import Source
from sain_core.errors import DatasetError, SainError
from sain_core.guarding.untrusted import MOST_BODIES
from sain_core.scene import THETA, X, Y
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import POSED, SHAPED, Column, Columns, describe_bodies
from sain_core.wire import decode_goal
from sain_core.wire.bodies import decode_bodies

POSE: Final = 3  # numbers: x, y, heading
Key = tuple[str, int]  # a bag, and an id of an episode or of a goal in it


class KnownBodies:
    """The bodies of the episodes of recordings, and the poses that their goals ask for."""

    def __init__(self, sources: Sequence[Source]) -> None:
        """Read them.

        Raises:
            DatasetError: a recording is damaged; bodies that cannot be, or that change within an
                episode; a goal that cannot be.
        """
        self._bodies: dict[Key, Bodies] = {}
        self._poses: dict[Key, ndarray] = {}  # (MOST_BODIES, 6); NaN: not asked
        for source in sources:
            try:
                self._read(source)
            except SainError as error:
                raise DatasetError(f"{source.bag.path}: {error}") from error
        plain = all(bodies.are_paper_disks for bodies in self._bodies.values())
        self._shaped = bool(self._poses) or not plain

    def of_bag(self, sha256: str) -> Callable[[int], Bodies]:
        """Return what gives the bodies of an episode of a recording, by default the paper's disks.

        It can be pickled.
        """
        found = {episode: known for (bag, episode), known in self._bodies.items() if bag == sha256}
        return partial(_get, found)

    def added_to(self, columns: Columns) -> Columns:
        """Return columns with those of bodies and poses; without, where no recording has any."""
        goals = columns[GOAL_ID]
        columns = {name: values for name, values in columns.items() if name != GOAL_ID}
        if not self._shaped:
            return {name: values for name, values in columns.items() if name not in SHAPED}
        bags, episodes = columns[Column.BAG_SHA256].tolist(), columns[Column.BAG_EPISODE].tolist()
        count = columns[Column.MASSES].shape[1]
        disks = Bodies.disks(count)
        known = [self._bodies.get(key, disks) for key in zip(bags, episodes, strict=True)]
        about = [describe_bodies(bodies) for bodies in known]
        columns = columns | {str(name): np.array([row[name] for row in about]) for name in SHAPED}
        if not self._poses:
            return columns
        nothing = np.full((MOST_BODIES, POSE + 3), np.nan)
        keys = zip(bags, goals.tolist(), strict=True)
        values = np.stack([self._poses.get(key, nothing) for key in keys])[:, :count]
        posed = np.isfinite(values).any(axis=(1, 2))
        for name in (Column.GOAL, Column.TOLERANCE):  # these are of the target
            columns[name] = columns[name].copy()
            columns[name][posed] = np.nan
        parts = np.split(values, (POSE, POSE + 2), axis=-1)
        flat = [np.ascontiguousarray(part).reshape(len(part), -1) for part in parts]
        names = POSED if self._kept else POSED[:-1]
        return columns | dict(zip(map(str, names), flat, strict=False))

    @property
    def _kept(self) -> bool:
        """Whether a goal of any recording keeps bodies."""
        return any(np.isfinite(poses[:, -1]).any() for poses in self._poses.values())

    def _read(self, source: Source) -> None:
        topics = {
            topic.name
            for topic in source.bag.topics
            if topic.type in (BODIES, GOAL) and parent_of(topic.name) == source.namespace
        }
        for received in source.bag.messages(topics):
            message, sha256 = received.message, source.sha256
            if received.type == GOAL:
                self._goal(sha256, message)
                continue
            bodies, key = decode_bodies(message), (sha256, int(message.episode_id))
            if self._bodies.setdefault(key, bodies) != bodies:
                raise DatasetError(
                    f"the bodies of episode {message.episode_id} change within it: first"
                    f" {_names(self._bodies[key])}, then {_names(bodies)}"
                )

    def _goal(self, sha256: str, message: Any) -> None:
        if not len(message.poses):  # columns of their own have its place
            return
        goal = decode_goal(message)
        largest = max((*goal.wanted, *goal.keep))
        if largest >= MOST_BODIES:
            raise DatasetError(f"a goal is given for body {largest}; at most {MOST_BODIES}")
        poses = np.full((MOST_BODIES, POSE + 3), np.nan)
        for pose in goal.poses:
            poses[pose.body, [X, Y, POSE]] = pose.x, pose.y, pose.tolerance
            if pose.heading is not None:
                poses[pose.body, [THETA, POSE + 1]] = pose.heading, pose.heading_tolerance
        poses[list(goal.keep), -1] = goal.keep_tolerance
        self._poses[sha256, int(message.goal_id)] = poses


def _get(bodies: dict[int, Bodies], episode: int) -> Bodies:
    return bodies.get(episode, PAPER_DISKS)


def _names(bodies: Bodies) -> str:
    return ", ".join(shape.name for shape in bodies.shapes)
