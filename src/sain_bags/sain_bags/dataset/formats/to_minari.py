"""Minari, through its own storage: a data set of offline reinforcement learning.

An unbroken sequence of T pushes (see `StoredRows.sequences`) is an episode: T + 1 observations, the
state before each push and the one after the last; T actions, which are the pushes; T rewards, minus
the target's distance to its goal [m]. It terminates where the target is within the tolerance of its
goal, and is truncated where it ends otherwise. Where no goal is known, rewards are NaN and nothing
terminates. All else that a row has is in ``infos``, which have T + 1 entries as observations have:
the one of push t is at t + 1, and the first one says nothing.
"""

import re
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import h5py  # noqa: F401  # which Minari itself would miss only when all recordings are read
import numpy as np
from gymnasium.spaces import Box
from minari.data_collector import EpisodeBuffer
from minari.dataset.minari_storage import MinariStorage
from numpy import ndarray

from sain_bags.dataset.formats.stored_rows import StoredRows, goal_distance, reached
from sain_core.push import PUSH_NAMES, PushLimits
from sain_core.transitions import PARTS, Column, Columns

ALLOWED: Final = r"[-\w]+-v\d+"  # what Minari takes for a name
NAME: Final = "sain-pushes-v0"  # where the folder's own is none
DESCRIPTION: Final = "Pushes of a mid disk against a target disk, converted from recordings by SAIN"
SPLITS: Final = "splits"  # key of the metadata: the first episode of each part, and the one after


def write(rows: StoredRows, folder: Path) -> None:
    """Write a data set into ``data``; the parts of its split follow one another."""
    path = folder / "data"
    path.mkdir(parents=True)
    states = Box(-np.inf, np.inf, Column.STATE.row_shape(rows.disks), np.float64)
    storage = MinariStorage.new(path, states, _pushes(rows.card["ranges"], rows.disks))
    name = rows.name if re.fullmatch(ALLOWED, rows.name) else NAME
    about = {"dataset_id": name, "minari_version": version("minari"), "description": DESCRIPTION}
    storage.update_metadata(about)
    splits: dict[str, list[int]] = {}
    storage.update_episodes(_episodes(rows, splits))
    storage.update_metadata({SPLITS: splits})


def _pushes(ranges: dict[str, Any], disks: int) -> Box:
    """Return the space of pushes: the limits, extended by recorded pushes beyond them."""
    limits = PushLimits()
    low = np.array([-np.pi, -limits.max_angle, 0.0, limits.min_speed])
    high = np.array([np.pi, limits.max_angle, limits.max_length, limits.max_speed])
    recorded = [ranges[name] for name in PUSH_NAMES[1:]]
    low = np.minimum(low, [spread["minimum"] for spread in recorded])
    high = np.maximum(high, [spread["maximum"] for spread in recorded])
    return Box(np.append(0.0, low), np.append(disks - 1.0, high), dtype=np.float64)


def _episodes(rows: StoredRows, splits: dict[str, list[int]]) -> Iterator[EpisodeBuffer]:
    """Stream the episodes of all parts, and note where each part begins and ends."""
    count = 0
    for part in PARTS:
        first = count
        for columns in rows.sequences(part):
            yield _episode(columns)
            count += 1
        splits[part] = [first, count]


def _episode(columns: Columns) -> EpisodeBuffer:
    terminations = reached(columns)
    truncations = np.zeros_like(terminations)
    truncations[-1] = not terminations[-1]
    return EpisodeBuffer(
        observations=np.concatenate([columns[Column.STATE], columns[Column.NEXT_STATE][-1:]]),
        actions=columns[Column.ACTION],
        rewards=-goal_distance(columns),
        terminations=terminations,
        truncations=truncations,
        infos={
            key: _after_nothing(values)
            for key, values in columns.items()
            if key not in (Column.STATE, Column.ACTION)
        },
    )


def _after_nothing(values: ndarray) -> ndarray | list[str]:
    """Return values behind one without a meaning: NaN, 0, false or an empty text."""
    nothing = np.full_like(values[:1], np.nan if values.dtype.kind == "f" else 0)
    if values.dtype.kind == "U":
        return ["", *values.tolist()]
    return np.concatenate([nothing, values])
