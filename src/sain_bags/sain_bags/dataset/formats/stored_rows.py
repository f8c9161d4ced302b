"""The rows that a format is written from: one number of disks, streamed from disk."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from sain_core.dataset import MOVED, Column, Columns, as_scenes, centres, row_bodies
from sain_core.scene import POSITION, TARGET, THETA
from sain_core.storage import read_arrays


@dataclass(frozen=True)
class StoredRows:
    """All rows with one number of disks, in order; never all in memory."""

    name: str  # of the data set's folder
    disks: int
    shards: tuple[Path, ...]
    parts: dict[str, frozenset[int]]  # of the split: the episodes of each
    card: dict[str, Any]  # of the data set
    advance: Callable[[int], None] = field(default=lambda rows: None)  # called with rows read

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
                    yield _joined(pieces)
                    pieces = []
                pieces.append({key: values[start:end] for key, values in chunk.items()})
        if pieces:
            yield _joined(pieces)


def goal_distance(columns: Columns) -> ndarray:
    """Return how far from its goal each push left the target (M,) [m]; NaN: there is no goal.

    Of a goal of poses: the body that is farthest from its pose.
    """
    ends = centres(columns[Column.NEXT_STATE])
    apart = np.linalg.norm(ends[:, min(TARGET, ends.shape[1] - 1)] - columns[Column.GOAL], axis=-1)
    if Column.GOAL_POSES not in columns:
        return np.asarray(apart)
    far, asked = _pose_errors(columns)[0], _asked(columns)
    return np.where(asked.any(axis=1), np.where(asked, far, 0.0).max(axis=1), apart)


def reached(columns: Columns) -> ndarray:
    """Return which pushes (M,) left the target, or all posed bodies, within the tolerances."""
    at_place = goal_distance(columns) <= columns[Column.TOLERANCE]
    if Column.GOAL_POSES not in columns:
        return np.asarray(at_place)
    far, turned = _pose_errors(columns)
    asked = _asked(columns)
    allowed = columns[Column.GOAL_TOLERANCES].reshape(*asked.shape, 2)
    in_place = (far <= allowed[..., 0]) & ((turned <= allowed[..., 1]) | np.isnan(turned))
    return np.where(asked.any(axis=1), (in_place | ~asked).all(axis=1), at_place)


def _asked(columns: Columns) -> ndarray:
    """Return which bodies (M, N) have a pose to come to."""
    poses = columns[Column.GOAL_POSES]
    return np.asarray(np.isfinite(poses.reshape(len(poses), -1, 3)[..., 0]))


def _pose_errors(columns: Columns) -> tuple[ndarray, ndarray]:
    """Return distances [m] and turns [rad] (M, N) from poses; NaN where none is asked for."""
    scenes, poses = as_scenes(columns[Column.NEXT_STATE]), columns[Column.GOAL_POSES]
    poses = poses.reshape(len(poses), -1, 3)
    turns = np.array([[s.symmetry for s in bodies.shapes] for bodies in row_bodies(columns)])
    turns = np.where(turns > 0.0, turns, 2 * np.pi)
    apart = scenes[..., THETA] - poses[..., 2]
    turned = np.abs(np.mod(apart + turns / 2, turns) - turns / 2)
    return np.linalg.norm(scenes[..., POSITION] - poses[..., :2], axis=-1), turned


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


def _joined(pieces: list[Columns]) -> Columns:
    return {key: np.concatenate([piece[key] for piece in pieces]) for key in pieces[0]}
