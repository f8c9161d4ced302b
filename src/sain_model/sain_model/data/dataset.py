"""Transitions (s, a, f_p(s, a), s') from disk, and their split by episode."""

import hashlib
from collections.abc import Sized
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.dataset import NEEDED, SHAPED, Column, Columns, Transitions, draw_parts
from sain_core.errors import DatasetError
from sain_core.push import mirror_pushes
from sain_core.scene import mirror_scenes
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scalars, Scenes
from sain_model.data.shard import NO_STEP
from sain_model.physics.friction import EpisodeFriction, FrictionFilter


@dataclass(frozen=True, eq=False)
class Dataset(Transitions):
    """M pushes with what physics predicted and what happened, to train or evaluate on.

    Attributes:
        physics_next: (M, N, 8), the nominal world's prediction, the paper's f_p.
        episode: which episode each belongs to.
        step: its place in the episode: the order of the data where no ``step`` is given.
        friction: the true friction with the table; NaN where it is not known.
        floor_next: the same push repeated in a world set to the observed state; NaN likewise.
        sha256: of all columns that are needed.
        sources: SHA-256 of each folder that it was put together from; empty: it is one folder.
        bodies: of all scenes.
    """

    physics_next: Scenes
    episode: Int[ndarray, "M"]
    step: Int[ndarray, "M"]
    friction: Scalars
    floor_next: Scenes
    sha256: str
    sources: tuple[str, ...] = ()
    bodies: Bodies = PAPER_DISKS

    @cached_property
    def inferred(self) -> dict[FrictionFilter, EpisodeFriction]:
        """What `sain_model.evaluation.history_errors` has inferred from these pushes so far."""
        return {}

    @property
    def parts(self) -> tuple[Self, ...]:
        """These transitions, as the only part of a data set with one number of disks."""
        return (self,)

    def mirrored(self) -> Self:
        """Return what would have happened in a mirror: the same physics."""
        scenes = (Column.STATE, Column.PHYSICS_NEXT, Column.NEXT_STATE, Column.FLOOR_NEXT)
        mirrored: dict[str, Any] = {n: mirror_scenes(getattr(self, n)) for n in scenes}
        return replace(self, action=mirror_pushes(self.action), **mirrored)


@dataclass(frozen=True)
class Split:
    """Three sets of transitions without a common episode."""

    train: Dataset
    validation: Dataset
    test: Dataset


def shard_paths(path: Path) -> list[Path]:
    """Return the paths of a folder's shards, in the order of names; a shard's own is alone.

    Raises:
        DatasetError: the folder has none.
    """
    shards = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    if not shards:
        raise DatasetError(f"{path} holds no shards *.npz")
    return shards


def from_shards(path: Path, shards: list[Columns]) -> Dataset:
    """Return the transitions of shards with one number of bodies; the path is for messages.

    Shapes and roles, where shards have them, are left out.
    """
    columns: dict[str, Any] = {
        name: np.concatenate([shard[name] for shard in shards])
        for name in shards[0]
        if name not in SHAPED
    }
    digest = hashlib.sha256()
    for column in NEEDED:
        digest.update(np.ascontiguousarray(columns[column]).tobytes())
    columns[Column.STEP] = _steps(path, columns[Column.EPISODE], columns[Column.STEP])
    return Dataset(**columns, sha256=digest.hexdigest())


def split_by_episode(
    data: Dataset, seed: int, validation: float, test: float, transitions: int = 0
) -> Split:
    """Split transitions so that no episode is in two parts; see `sain_core.dataset.draw_parts`.

    With no share for the test, training and validation share all: 90 to 10 or 80 to 20 in the
    paper. `transitions` is what `limit_training` leaves; 0: all.

    Raises:
        DatasetError: too few episodes for the parts, or too few transitions.
    """
    parts = draw_parts(data.episode, seed, validation, test)
    split = Split(*(data.select(rows) for rows in parts))
    return limit_training(split, transitions) if transitions else split


def check_held_out(test: Sized) -> None:
    """Check that there are episodes to measure errors on.

    Raises:
        DatasetError: none is held out.
    """
    if not len(test):
        raise DatasetError("errors need held-out episodes; give --test above 0")


def limit_training(split: Split, transitions: int) -> Split:
    """Return a split with so many transitions to train on, and as small a share to validate on.

    Episodes are taken in order, the last one in part; what is held out stays whole.

    Raises:
        DatasetError: there are not that many.
    """
    validated = validation_share(len(split.train), len(split.validation), transitions)
    return Split(
        split.train.select(np.arange(len(split.train)) < transitions),
        split.validation.select(np.arange(len(split.validation)) < validated),
        split.test,
    )


def validation_share(count: int, validated: int, transitions: int) -> int:
    """Return how many transitions validate so many of the `count` that there are to train on.

    Raises:
        DatasetError: there are not that many.
    """
    if transitions > count:
        raise DatasetError(
            f"{transitions} transitions to train on are asked for; there are {count}"
        )
    return max(round(validated * transitions / count), 1)


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
