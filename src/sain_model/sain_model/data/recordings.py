"""Data sets of pushes against any body, to identify a laboratory."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sain_core.shapes.bodies import Bodies
from sain_core.transitions import Column, Columns, row_bodies
from sain_model.data.dataset import shard_paths
from sain_model.data.shard import read_shard
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.laboratory import count_episodes


def load_recording(path: Path) -> list[ObservedPushes]:
    """Return the pushes of a shard, or of all shards of a folder, by the bodies of the scenes.

    Pushes and strokes are apart.

    Episodes are counted from 0.

    Raises:
        DatasetError: see `read_shard`; or the path holds no shards.
    """
    found: dict[tuple[Bodies, int], list[Columns]] = {}
    for shard in shard_paths(path):
        columns = read_shard(shard)
        bodies = row_bodies(columns)
        for kind in dict.fromkeys(bodies):
            chosen = np.array([one == kind for one in bodies])
            part = {name: values[chosen] for name, values in columns.items()}
            found.setdefault((kind, part[Column.ACTION].shape[1]), []).append(part)
    episodes = np.unique(
        np.concatenate([part[Column.EPISODE] for parts in found.values() for part in parts])
    )
    return [_joined(parts, kind, episodes) for (kind, _), parts in found.items()]


def first_pushes(parts: Sequence[ObservedPushes], most: int) -> list[ObservedPushes]:
    """Return the pushes of the first whole episodes, as many as hold at most so many pushes."""
    counts = sum(np.bincount(part.episode, minlength=count_episodes(parts)) for part in parts)
    keep = int(np.searchsorted(np.cumsum(counts), most, side="right"))
    chosen = (part.select(part.episode < keep) for part in parts)
    return [part for part in chosen if len(part)]


def _rows(columns: Columns) -> int:
    return len(columns[Column.ACTION])


def _joined(parts: list[Columns], bodies: Bodies, episodes: np.ndarray) -> ObservedPushes:
    state, action, next_state, episode = (
        np.concatenate([part[name] for part in parts])
        for name in (Column.STATE, Column.ACTION, Column.NEXT_STATE, Column.EPISODE)
    )
    return ObservedPushes(state, action, next_state, np.searchsorted(episodes, episode), bodies)
