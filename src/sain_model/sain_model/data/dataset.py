"""Transitions (s, a, f_p(s, a), s') from disk, and their split by episode."""

import hashlib
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.push import mirror_pushes
from sain_core.scene import mirror_scenes
from sain_core.split import draw_parts
from sain_core.types import Mask, Pushes, Scalars, Scenes
from sain_model.data.shard import FLOOR, FRICTION, NEEDED, NO_STEP, STEP, read_shard
from sain_model.physics.friction import EpisodeFriction, FrictionFilter


@dataclass(frozen=True)
class Transitions:
    """M pushes with what physics predicted and what happened.

    Attributes:
        scenes: before the push.
        pushes: the pushes.
        physics_next: the nominal world's prediction, the paper's f_p.
        next_scenes: after the push.
        episodes: which episode each belongs to.
        steps: its place in the episode: the order of the data where no ``step`` is given.
        friction: the true friction with the table; NaN where it is not known.
        floor_next: the same push repeated in a world set to the observed state; NaN likewise.
        sha256: of all arrays that are needed.
        sources: SHA-256 of each folder that it was put together from; empty: it is one folder.
    """

    scenes: Scenes
    pushes: Pushes
    physics_next: Scenes
    next_scenes: Scenes
    episodes: Int[ndarray, "M"]
    steps: Int[ndarray, "M"]
    friction: Scalars
    floor_next: Scenes
    sha256: str
    sources: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of pushes M."""
        return len(self.pushes)

    @property
    def disks(self) -> int:
        """The number of disks N in every scene."""
        return int(self.scenes.shape[1])

    @property
    def arrays(self) -> dict[str, ndarray]:
        """All arrays by name; each has one row a push."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, ndarray)}

    @cached_property
    def inferred(self) -> dict[FrictionFilter, EpisodeFriction]:
        """What `sain_model.evaluation.history_errors` has inferred from these pushes so far."""
        return {}

    @property
    def parts(self) -> tuple[Self, ...]:
        """These transitions, as the only part of a data set with one number of disks."""
        return (self,)

    def select(self, rows: Mask) -> Self:
        """Return the pushes that a mask (M,) picks."""
        return replace(self, **{name: array[rows] for name, array in self.arrays.items()})

    def mirrored(self) -> Self:
        """Return what would have happened in a mirror: the same physics."""
        return replace(
            self,
            scenes=mirror_scenes(self.scenes),
            pushes=mirror_pushes(self.pushes),
            physics_next=mirror_scenes(self.physics_next),
            next_scenes=mirror_scenes(self.next_scenes),
            floor_next=mirror_scenes(self.floor_next),
        )


@dataclass(frozen=True)
class Split:
    """Three sets of transitions without a common episode."""

    train: Transitions
    validation: Transitions
    test: Transitions


def load_transitions(path: Path) -> Transitions:
    """Read a shard, or all shards ``*.npz`` of a folder in the order of their names.

    Raises:
        DatasetError: nothing there, a damaged shard, a missing key, arrays that do not fit
            together, NaN or Inf, or shards with different numbers of disks.
    """
    shards = read_shards(path)
    counts = {name: shard["state"].shape[1] for name, shard in shards.items()}
    if len(set(counts.values())) > 1:
        raise DatasetError(f"{path} mixes numbers of disks: {counts}; use one folder for each")
    return from_shards(path, list(shards.values()))


def read_shards(path: Path) -> dict[str, dict[str, ndarray]]:
    """Return the arrays of each shard by its name, in the order of names; see `read_shard`."""
    shards = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    if not shards:
        raise DatasetError(f"{path} holds no shards *.npz")
    return {shard.name: read_shard(shard) for shard in shards}


def from_shards(path: Path, shards: list[dict[str, ndarray]]) -> Transitions:
    """Return the transitions of shards with one number of disks; the path is for messages."""
    arrays = {key: np.concatenate([shard[key] for shard in shards]) for key in shards[0]}
    digest = hashlib.sha256()
    for key in NEEDED:
        digest.update(np.ascontiguousarray(arrays[key]).tobytes())
    return Transitions(
        arrays["state"],
        arrays["action"],
        arrays["physics_next"],
        arrays["next_state"],
        arrays["episode"],
        _steps(path, arrays["episode"], arrays[STEP]),
        arrays[FRICTION],
        arrays[FLOOR],
        digest.hexdigest(),
    )


def split_by_episode(data: Transitions, seed: int, validation: float, test: float) -> Split:
    """Split transitions so that no episode is in two parts.

    Args:
        data: pushes of at least as many episodes as there are parts.
        seed: decides which episodes go where.
        validation: share of the episodes to choose the best epoch by.
        test: share of the episodes held out for the card; 0: none are, and training and
            validation share all, 90 to 10 or 80 to 20 in the paper.

    Raises:
        DatasetError: too few episodes for the parts.
    """
    parts = draw_parts(data.episodes, seed, validation, test)
    return Split(*(data.select(rows) for rows in parts))


def check_held_out(split: Split) -> None:
    """Check that there are episodes to measure errors on.

    Raises:
        DatasetError: none is held out.
    """
    if not len(split.test):
        raise DatasetError("errors need held-out episodes; give --test above 0")


def limit_training(split: object, transitions: int) -> Split:
    """Return a split with so many transitions to train on, and as small a share to validate on.

    Episodes are taken in order, the last one in part; what is held out stays whole.

    Raises:
        DatasetError: there are not that many, or numbers of disks differ.
    """
    if not isinstance(split, Split):
        raise DatasetError("--transitions needs data with one number of disks")
    count = len(split.train)
    if transitions > count:
        raise DatasetError(
            f"{transitions} transitions to train on are asked for; there are {count}"
        )
    validated = max(round(len(split.validation) * transitions / count), 1)
    return Split(
        split.train.select(np.arange(count) < transitions),
        split.validation.select(np.arange(len(split.validation)) < validated),
        split.test,
    )


def _steps(path: Path, episodes: ndarray, steps: ndarray) -> Int[ndarray, "M"]:
    """Return the place of each push in its episode; by the order of the data where none tells."""
    if (steps == NO_STEP).any():
        return np.arange(len(steps))
    order = np.lexsort((steps, episodes))
    same = (np.diff(episodes[order]) == 0) & (np.diff(steps[order]) == 0)
    if same.any():
        row = order[int(np.argmax(same))]
        raise DatasetError(
            f"{path}: episode {episodes[row]} has two pushes with step {steps[row]}; each needs"
            " its own"
        )
    return steps
