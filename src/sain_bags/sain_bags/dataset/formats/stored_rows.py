"""The rows that a format is written from: one number of disks, streamed from disk."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from sain_core.dataset import MOVED, Column, Columns, centres
from sain_core.scene import TARGET
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
    """Return how far from its goal each push left the target (M,) [m]; NaN: there is no goal."""
    ends = centres(columns[Column.NEXT_STATE])[:, TARGET]
    return np.asarray(np.linalg.norm(ends - columns[Column.GOAL], axis=-1))


def reached(columns: Columns) -> ndarray:
    """Return which pushes (M,) left the target within the tolerance of its goal."""
    return np.asarray(goal_distance(columns) <= columns[Column.TOLERANCE])


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
