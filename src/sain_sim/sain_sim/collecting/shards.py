"""Transitions on disk: compressed npz shards of 1,000, each written whole or not at all."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sain_core.errors import DatasetError
from sain_core.shapes.registry import get_shape
from sain_core.shards import SHARD_PATTERN, SHARD_SIZE, shard_path
from sain_core.storage import PARTIAL, read_arrays, write_arrays


class Transition(NamedTuple):
    """One push and what came of it. Scenes (N, 8) are stored flat; N = 2 gives the paper's 16."""

    state: np.ndarray  # (8 N,) before the push
    action: np.ndarray  # (3,) location, angle, length
    physics_next: np.ndarray  # (8 N,) the shadow's prediction
    next_state: np.ndarray  # (8 N,) after the push
    floor_next: np.ndarray  # (8 N,) the same push with the true parameters again; NaN: not done
    episode: int
    step: int  # of the episode
    seed: int  # of the collection
    masses: np.ndarray  # (N,) [kg]
    radii: np.ndarray  # (N,) [m]
    friction: float  # with the table
    rim_friction: float
    tool_friction: float
    moved: bool  # the target moved by more than the paper's 2 mm
    duration: float  # simulated time of the push [s]
    roughness: Mapping[str, np.ndarray] = {}  # what is rough; each stored as ``rough_NAME``
    shapes: tuple[str, ...] = ()  # (N,) names; which disks have a NAME is stored as ``NAMEs``


def write_shard(folder: Path, index: int, transitions: Sequence[Transition]) -> None:
    """Write a shard: whole, or not at all.

    Raises:
        OutputError: when the folder cannot be written, or the disk is full.
    """
    rows = [_row(item) for item in transitions]
    columns = {name: np.stack([np.asarray(row[name]) for row in rows]) for name in rows[0]}
    write_arrays(shard_path(folder, index), columns)


def _row(transition: Transition) -> dict[str, Any]:
    """Return what is stored of a transition."""
    row = transition._asdict()
    rough, shapes = row.pop("roughness"), row.pop("shapes")
    cornered = [name for name in dict.fromkeys(shapes) if not get_shape(name).is_round]
    marks = {f"{name}s": np.array([shape == name for shape in shapes]) for name in cornered}
    return row | marks | {f"rough_{name}": value for name, value in rough.items()}


def full_shards(folder: Path) -> int:
    """Return how many whole shards of 1,000 transitions a folder has, from the first on."""
    count = 0
    while shard_path(folder, count).exists() and _size(shard_path(folder, count)) == SHARD_SIZE:
        count += 1
    return count


def last_transition(folder: Path, index: int) -> tuple[int, int]:
    """Return episode and step of the last transition in the index-th shard."""
    shard = _load(shard_path(folder, index))
    return int(shard["episode"][-1]), int(shard["step"][-1])


def load_shards(folder: Path) -> dict[str, np.ndarray]:
    """Return all transitions of a folder, one array (M, ...) for each field of `Transition`.

    Raises:
        DatasetError: when there are none, or a shard is damaged.
    """
    paths = sorted(folder.glob(SHARD_PATTERN))
    if not paths:
        raise DatasetError(f"{folder} holds no shards; ros2 run sain_sim collect --out makes some")
    shards = [_load(path) for path in paths]
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def _size(path: Path) -> int:
    return len(_load(path)["episode"])


def _load(path: Path) -> dict[str, np.ndarray]:
    try:
        arrays = read_arrays(path)
    except DatasetError as error:
        raise DatasetError(f"{error}; delete it to have it made anew") from error
    missing = {"episode", "step", "state"} - arrays.keys()
    if missing:
        raise DatasetError(f"{path} lacks {', '.join(sorted(missing))}; no collection made it")
    return arrays


def remove_leftovers(folder: Path) -> None:
    """Delete what a killed run left half-written."""
    for path in folder.glob(f"*{PARTIAL}"):
        path.unlink()
