"""Transitions on disk: compressed npz shards of 1,000, each written whole or not at all."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from sain_core.errors import DatasetError, OutputError

SHARD_SIZE: Final = 1000  # transitions, as in the paper (section III-B c)


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


def shard_path(folder: Path, index: int) -> Path:
    """Return where the index-th shard is."""
    return folder / f"shard-{index:05d}.npz"


def write_shard(folder: Path, index: int, transitions: Sequence[Transition]) -> None:
    """Write a shard under a temporary name, then rename it.

    Raises:
        OutputError: when the folder cannot be written.
    """
    rows = [_row(item) for item in transitions]
    columns = {name: np.stack([np.asarray(row[name]) for row in rows]) for name in rows[0]}
    path = shard_path(folder, index)
    partial = path.with_suffix(".partial")
    try:
        with partial.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **columns)
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error


def _row(transition: Transition) -> dict[str, Any]:
    """Return what is stored of a transition."""
    row = transition._asdict()
    rough = row.pop("roughness")
    return row | {f"rough_{name}": value for name, value in rough.items()}


def full_shards(folder: Path) -> int:
    """Return how many whole shards of 1,000 transitions a folder has, from the first on."""
    count = 0
    while shard_path(folder, count).exists() and _size(shard_path(folder, count)) == SHARD_SIZE:
        count += 1
    return count


def last_transition(folder: Path, index: int) -> tuple[int, int]:
    """Return episode and step of the last transition in the index-th shard."""
    with np.load(shard_path(folder, index)) as shard:
        return int(shard["episode"][-1]), int(shard["step"][-1])


def load_shards(folder: Path) -> dict[str, np.ndarray]:
    """Return all transitions of a folder, one array (M, ...) for each field of `Transition`.

    Raises:
        DatasetError: when there are none, or a shard is damaged.
    """
    paths = sorted(folder.glob("shard-*.npz"))
    if not paths:
        raise DatasetError(f"{folder} holds no shards; ros2 run sain_sim collect --out makes some")
    shards = [_load(path) for path in paths]
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def _size(path: Path) -> int:
    return len(_load(path)["episode"])


def _load(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path) as shard:
            return dict(shard)
    except (OSError, ValueError, EOFError) as error:
        raise DatasetError(f"{path} is damaged: {error}; delete it to have it made anew") from error


def remove_leftovers(folder: Path) -> None:
    """Delete what a killed run left half-written."""
    for path in folder.glob("*.partial"):
        path.unlink()
