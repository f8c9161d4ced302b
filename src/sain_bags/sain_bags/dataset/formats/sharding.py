"""Rows of a conversion on disk: npz shards with the columns of `sain_core.transitions`."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sain_bags.dataset.rows import RowBlock
from sain_core.errors import DatasetError
from sain_core.storage import read_arrays, write_arrays
from sain_core.transitions import RECORDED, SHARD_SIZE, Column, Columns, shard_path


class Sharding:
    """Gathers rows into shards, each of scenes with one number of disks."""

    def __init__(self, size: int = SHARD_SIZE) -> None:
        """Begin empty; a shard has `size` rows."""
        self._size = size
        self._waiting: dict[int, list[Columns]] = {}  # by number of disks

    def add(self, blocks: Sequence[RowBlock]) -> list[Columns]:
        """Add rows; return the shards that they complete, in order of completion."""
        full: list[tuple[int, Columns]] = []
        for block in blocks:
            disks = block.columns[Column.MASSES].shape[1]
            waiting = self._waiting.setdefault(disks, [])
            before = sum(map(_length, waiting))
            waiting.append(block.columns)
            if before + len(block.places) < self._size:
                continue
            rows = _joined(waiting)
            ends = range(self._size, _length(rows) + 1, self._size)
            for end in ends:
                last = int(block.places[end - before - 1])
                full.append((last, _tidy(rows, slice(end - self._size, end))))
            left = len(ends) * self._size
            self._waiting[disks] = [_cut(rows, slice(left, None))]
        return [columns for _, columns in sorted(full, key=lambda shard: shard[0])]

    def rest(self) -> Iterator[Columns]:
        """Yield the incomplete shards."""
        for disks in sorted(self._waiting):
            rows = _joined(self._waiting[disks])
            if _length(rows):
                yield _tidy(rows, slice(None))


def write_shard(folder: Path, index: int, arrays: Columns) -> Columns:
    """Write columns as a shard, whole or not at all, unless it is there already; return them.

    Raises:
        DatasetError: there is a shard in its place, damaged or with other rows.
        OutputError: the folder cannot be written, or the disk is full.
    """
    path = shard_path(folder, index)
    if not path.exists():
        write_arrays(path, arrays, deflate_numbers=False)
        return arrays
    found = read_arrays(path)
    for key, wanted in arrays.items():
        numbers = wanted.dtype.kind == "f"
        if key not in found or not np.array_equal(found[key], wanted, equal_nan=numbers):
            raise DatasetError(
                f"{path} is there with another {key}, by another version of this program or of"
                " the prior; --overwrite makes all shards anew"
            )
    return arrays


def _length(columns: Columns) -> int:
    return len(columns[Column.PUSH_ID])


def _joined(parts: Sequence[Columns]) -> Columns:
    if len(parts) == 1:
        return parts[0]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _cut(columns: Columns, rows: slice) -> Columns:
    return {name: column[rows] for name, column in columns.items()}


def _tidy(columns: Columns, rows: slice) -> Columns:
    """Return some rows with columns in order, and texts as wide as the longest of them."""
    tidy = {}
    for name in map(str, RECORDED):
        column = columns[name][rows]
        if column.dtype.kind == "U":
            width = max(int(np.strings.str_len(column).max()), 1)
            column = column.astype(f"<U{width}")
        tidy[name] = np.ascontiguousarray(column)
    return tidy
