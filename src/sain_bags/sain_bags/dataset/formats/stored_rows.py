"""The rows that a format is written from: one number of disks, streamed from disk."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from sain_core.goal import BodyPose, Goal, Judgement
from sain_core.storage import read_arrays
from sain_core.transitions import MOVED, Column, Columns, as_scenes, centres, row_bodies

FindImage = Callable[[str, str, int], ndarray]  # by SHA-256 of the recording, column and time


def no_image(sha256: str, key: str, time: int) -> ndarray:
    """Raise `LookupError`: there are no images."""
    raise LookupError(f"there is no image {key} of {time} in {sha256}")


@dataclass(frozen=True)
class StoredRows:
    """All rows with one number of disks, in order; never all in memory."""

    name: str  # of the data set's folder
    disks: int
    shards: tuple[Path, ...]
    parts: dict[str, frozenset[int]]  # of the split: the episodes of each
    card: dict[str, Any]  # of the data set
    advance: Callable[[int], None] = field(default=lambda rows: None)  # called with rows read
    image: FindImage = no_image

    def stated(self, keys: Collection[str]) -> set[str]:
        """Return which of these columns have a finite number in any row."""
        return {
            key
            for arrays in map(read_arrays, self.shards)
            for key in keys
            if np.isfinite(arrays[key]).any()
        }

    def chunks(self, part: str) -> Iterator[Columns]:
        """Stream the rows of a part of the split, at most a shard's at a time."""
        episodes = np.array(sorted(self.parts[part]), dtype=np.int64)
        if not len(episodes):
            return
        for path in self.shards:
            columns = read_arrays(path)
            mask = np.isin(columns[Column.EPISODE], episodes)
            self.advance(int(mask.sum()))
            if mask.any():
                yield {key: values[mask] for key, values in columns.items()}

    def sequences(self, part: str) -> Iterator[Columns]:
        """Stream unbroken sequences of pushes: the episodes of other formats.

        An episode is broken where a push between two others is no row, where a disk lies 2 mm or
        more from where the push before had left it, and after a push that reached the goal.
        """
        pieces: list[Columns] = []
        for chunk in self.chunks(part):
            begins = _begins(pieces[-1] if pieces else None, chunk)
            starts = sorted({0, *np.flatnonzero(begins).tolist()})
            for start, end in zip(starts, [*starts[1:], len(begins)], strict=True):
                if pieces and begins[start]:
                    yield joined(pieces)
                    pieces = []
                pieces.append({key: values[start:end] for key, values in chunk.items()})
        if pieces:
            yield joined(pieces)


def goal_distance(columns: Columns) -> ndarray:
    """Return how far from its goal each push left the bodies (M,) [m]; NaN: there is no goal."""
    return np.array([np.nan if judged is None else judged.distance for judged in _judge(columns)])


def reached(columns: Columns) -> ndarray:
    """Return which pushes (M,) left all bodies of the goal within the tolerances."""
    return np.array([judged is not None and not judged.missed for judged in _judge(columns)])


def _judge(columns: Columns) -> list[Judgement | None]:
    """Judge the scene after each push; None: there is no goal."""
    scenes = as_scenes(columns[Column.NEXT_STATE])
    goals = [_goal(columns, row, scenes.shape[1]) for row in range(len(scenes))]
    return [
        None if goal is None else goal.judge(scene, scene, bodies)
        for goal, scene, bodies in zip(goals, scenes, row_bodies(columns), strict=True)
    ]


def _goal(columns: Columns, row: int, count: int) -> Goal | None:
    """Return the goal of a row with so many bodies, without those that are to be kept."""
    poses = columns[Column.GOAL_POSES][row].reshape(count, 3).tolist()
    allowed = columns[Column.GOAL_TOLERANCES][row].reshape(count, 2).tolist()
    wanted = tuple(
        BodyPose(body, x, y, tolerance=near)
        if isnan(heading)
        else BodyPose(body, x, y, heading, near, turn)
        for body, ((x, y, heading), (near, turn)) in enumerate(zip(poses, allowed, strict=True))
        if not isnan(x)
    )
    return Goal(wanted) if wanted else None


def _begins(before: Columns | None, chunk: Columns) -> ndarray:
    """Return which rows (M,) do not continue the row before them."""
    last = chunk if before is None else before
    earlier = {key: np.concatenate([last[key][-1:], chunk[key][:-1]]) for key in chunk}
    moved = centres(chunk[Column.STATE]) - centres(earlier[Column.NEXT_STATE])  # (M, N, 2)
    begins = np.asarray(
        (chunk[Column.EPISODE] != earlier[Column.EPISODE])
        | (chunk[Column.STEP] != earlier[Column.STEP] + 1)
        | (np.linalg.norm(moved, axis=-1) >= MOVED).any(axis=-1)
        | reached(earlier)
    )
    begins[0] |= before is None
    return begins


def joined(parts: Sequence[Columns]) -> Columns:
    """Return rows one after the other."""
    if len(parts) == 1:
        return parts[0]
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
