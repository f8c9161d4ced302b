"""Rows on disk: the paper's compressed npz shards, with the keys of a collection's.

The keys of `sain_sim`'s shards mean the same here, so that a model trains on either; what only a
recording knows has keys of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.rows import Row
from sain_core.errors import DatasetError
from sain_core.scene import MASS, RADIUS
from sain_core.shards import shard_path
from sain_core.storage import read_arrays, write_arrays

STATES: Final = ("state", "physics_next", "next_state")


@dataclass(frozen=True)
class Numbered:
    """A row, and where it stands in the data set."""

    row: Row
    episode: int  # counted over all recordings
    step: int  # of the episode
    bag_sha256: str  # of the recording's MCAP file


def columns(rows: Sequence[Numbered]) -> dict[str, ndarray]:
    """Return rows with one number of disks as arrays, one entry a row."""
    records = [_record(numbered) for numbered in rows]
    return {key: np.stack([record[key] for record in records]) for key in records[0]}


def write_shard(folder: Path, index: int, arrays: dict[str, ndarray]) -> dict[str, ndarray]:
    """Write columns as a shard, whole or not at all, unless it is there already; return them.

    Raises:
        DatasetError: there is a shard in its place, damaged or with other rows.
        OutputError: the folder cannot be written, or the disk is full.
    """
    path = shard_path(folder, index)
    if not path.exists():
        write_arrays(path, arrays)
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


def _record(numbered: Numbered) -> dict[str, ndarray]:
    row = numbered.row
    record: dict[str, Any] = {
        "state": row.state.ravel(),
        "action": row.action,
        "physics_next": row.physics_next.ravel(),
        "next_state": row.next_state.ravel(),
        "episode": np.int64(numbered.episode),
        "step": np.int64(numbered.step),
        "masses": row.state[:, MASS],
        "radii": row.state[:, RADIUS],
        "moved": row.moved,
        "duration": row.duration,
        "goal": row.goal,
        "tolerance": row.tolerance,
        "push_id": np.uint64(row.push_id),
        "bag_episode": np.uint64(row.episode_id),
        "bag_scene": np.uint64(row.scene_id),
        "outcome": np.int64(row.outcome),
        "stamp": np.int64(row.stamps[0]),
        "next_stamp": np.int64(row.stamps[1]),
        "log_time": np.int64(row.log_time),
        "source": row.source,
        "physics_source": row.physics_source,
        "bag_sha256": numbered.bag_sha256,
    }
    return {key: np.asarray(value) for key, value in record.items()}
