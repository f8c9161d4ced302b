"""Several data sets as one, also with different numbers of disks.

Scenes of N = 2 and N = 5 fit into no common array: a mixed data set holds one `Dataset` for
each number of disks. Episodes of different folders never have the same label, and a push that is
in two of the folders is refused: it could end up on both sides of a split.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, Self

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.dataset import Column, draw_parts
from sain_core.errors import DatasetError
from sain_core.types import Mask
from sain_model.data.dataset import (
    Dataset,
    Split,
    from_shards,
    read_shards,
    split_by_episode,
)


@dataclass(frozen=True)
class MixedDataset:
    """Pushes of scenes with different numbers of disks.

    Attributes:
        parts: those of one number of disks each, in order of it.
        sha256: of all parts.
        sources: SHA-256 of each folder and number of disks that it was put together from.
    """

    parts: tuple[Dataset, ...]
    sha256: str
    sources: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of pushes M of all parts."""
        return sum(len(part) for part in self.parts)

    @property
    def episode(self) -> Int[ndarray, "M"]:
        """Which episode each push belongs to, part by part; no two parts share one."""
        return np.concatenate([part.episode for part in self.parts])

    def select(self, rows: Mask) -> Self:
        """Return the pushes that a mask (M,) over all parts picks."""
        ends = np.cumsum([len(part) for part in self.parts])[:-1]
        masks = np.split(rows, ends)
        picked = (part.select(mask) for part, mask in zip(self.parts, masks, strict=True))
        return replace(self, parts=tuple(part for part in picked if len(part)))


@dataclass(frozen=True)
class MixedSplit:
    """Three mixed sets without a common episode; what `Split` is for one number of disks."""

    train: MixedDataset
    validation: MixedDataset
    test: MixedDataset


def load_datasets(paths: Sequence[Path]) -> Dataset | MixedDataset:
    """Read one or more shards or folders of them as one data set.

    Raises:
        DatasetError: see `load_transitions`; or a push that is in two of them.
    """
    sources = [(path, part) for path in paths for part in _by_count(path)]
    if len(sources) == 1:
        return sources[0][1]
    _check_apart(sources)
    labelled, first = [], 0
    for _, part in sources:
        names, labels = np.unique(part.episode, return_inverse=True)
        labelled.append(replace(part, episode=first + labels))
        first += len(names)
    hashes = tuple(part.sha256 for part in labelled)
    sha256 = hashlib.sha256(" ".join(hashes).encode()).hexdigest()
    disks = attrgetter("disks")
    grouped = groupby(sorted(labelled, key=disks), key=disks)
    parts = tuple(_joined(list(group), sha256, hashes) for _, group in grouped)
    return parts[0] if len(parts) == 1 else MixedDataset(parts, sha256, hashes)


def split_datasets(
    data: Dataset | MixedDataset, seed: int, validation: float, test: float, transitions: int = 0
) -> Split | MixedSplit:
    """Split a data set so that no episode is in two parts; see `split_by_episode`.

    Raises:
        DatasetError: too few episodes or transitions, or these are limited and numbers of disks
            differ.
    """
    if isinstance(data, Dataset):
        return split_by_episode(data, seed, validation, test, transitions)
    if transitions:
        raise DatasetError("--transitions needs data with one number of disks")
    parts = draw_parts(data.episode, seed, validation, test)
    return MixedSplit(*(data.select(rows) for rows in parts))


def _by_count(path: Path) -> list[Dataset]:
    """Return what a folder holds, by the number of disks."""
    shards = list(read_shards(path).values())
    counts = sorted({shard[Column.STATE].shape[1] for shard in shards})
    return [
        from_shards(path, [shard for shard in shards if shard[Column.STATE].shape[1] == count])
        for count in counts
    ]


def _joined(parts: list[Dataset], sha256: str, sources: tuple[str, ...]) -> Dataset:
    """Return parts of the same bodies and with labels of their own as one."""
    columns = [part.arrays for part in parts]
    arrays: dict[str, Any] = {
        name: np.concatenate([column[name] for column in columns]) for name in columns[0]
    }
    return Dataset(**arrays, sha256=sha256, sources=sources, bodies=parts[0].bodies)


def _check_apart(sources: list[tuple[Path, Dataset]]) -> None:
    """Raise `DatasetError` when the same push from the same scene is in two places."""
    seen: dict[bytes, Path] = {}
    for path, part in sources:
        flat = np.concatenate([part.state.reshape(len(part), -1), part.action], axis=-1)
        keys = {row.tobytes() for row in flat}
        for key in keys & seen.keys():
            raise DatasetError(
                f"{seen[key]} and {path} hold the same push; give each data set once"
            )
        seen |= dict.fromkeys(keys, path)
