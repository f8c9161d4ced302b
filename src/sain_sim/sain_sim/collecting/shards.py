"""Rows of a collection on disk: npz shards of 1,000, each written whole or not at all."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sain_core.dataset import (
    COLLECTED,
    NEEDED,
    SHARD_PATTERN,
    SHARD_SIZE,
    Column,
    Columns,
    Row,
    shard_path,
)
from sain_core.errors import DatasetError
from sain_core.storage import PARTIAL, read_arrays, write_arrays


def write_shard(folder: Path, index: int, rows: Sequence[Row]) -> None:
    """Write a shard: whole, or not at all.

    Raises:
        OutputError: when the folder cannot be written, or the disk is full.
    """
    known = [column for column in COLLECTED if column in rows[0]]
    columns: Columns = {
        str(column): np.array([row[column] for row in rows], dtype=column.dtype) for column in known
    }
    for name in rows[0]:
        if name not in columns:  # which shapes there are, and what is rough
            columns[name] = np.stack([np.asarray(row[name]) for row in rows])
    write_arrays(shard_path(folder, index), columns)


def full_shards(folder: Path) -> int:
    """Return how many whole shards of 1,000 transitions a folder has, from the first on."""
    count = 0
    while shard_path(folder, count).exists():
        if len(_load(shard_path(folder, count))[Column.EPISODE]) != SHARD_SIZE:
            break
        count += 1
    return count


def last_transition(folder: Path, index: int) -> tuple[int, int]:
    """Return episode and step of the last transition in the index-th shard."""
    shard = _load(shard_path(folder, index))
    return int(shard[Column.EPISODE][-1]), int(shard[Column.STEP][-1])


def load_shards(folder: Path) -> Columns:
    """Return all transitions of a folder, one array (M, ...) for each column.

    Raises:
        DatasetError: when there are none, or a shard is damaged.
    """
    paths = sorted(folder.glob(SHARD_PATTERN))
    if not paths:
        raise DatasetError(f"{folder} holds no shards; ros2 run sain_sim collect --out makes some")
    shards = [_load(path) for path in paths]
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def _load(path: Path) -> Columns:
    try:
        arrays = read_arrays(path)
    except DatasetError as error:
        raise DatasetError(f"{error}; delete it to have it made anew") from error
    missing = {Column.STEP, *NEEDED} - arrays.keys()
    if missing:
        raise DatasetError(f"{path} lacks {', '.join(sorted(missing))}; no collection made it")
    return arrays


def remove_leftovers(folder: Path) -> None:
    """Delete what a killed run left half-written."""
    for path in folder.glob(f"*{PARTIAL}"):
        path.unlink()
