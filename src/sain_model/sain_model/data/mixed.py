"""Data sets from disk, several as one, whatever their bodies.

Scenes of N = 2 and N = 5 fit into no common array: a mixed data set holds one `Dataset` for
all scenes of the same shapes and roles. Episodes of different folders
never have the same label, and a push that is in two of the folders is refused: it could end up on
both sides of a split.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.dataset import SHAPED, Column, draw_parts
from sain_core.errors import DatasetError
from sain_core.shapes.bodies import bodies_named
from sain_core.types import Mask
from sain_model.data.dataset import (
    Dataset,
    Split,
    from_shards,
    shard_paths,
    split_by_episode,
    validation_share,
)
from sain_model.data.shard import read_shard


@dataclass(frozen=True)
class MixedDataset:
    """Pushes of scenes with any bodies.

    Attributes:
        parts: those of the same bodies each; disks first, in order of their number.
        sha256: of all parts.
        sources: SHA-256 of each folder and number of disks that it was put together from; empty:
            it is one.
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
        return self._column(Column.EPISODE)

    @property
    def step(self) -> Int[ndarray, "M"]:
        """The place of each push in its episode, part by part."""
        return self._column(Column.STEP)

    def _column(self, name: str) -> Int[ndarray, "M"]:
        columns = (getattr(part, name) for part in self.parts)
        return np.concatenate([np.zeros(0, np.int64), *columns])

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


def load_datasets(paths: Sequence[Path]) -> MixedDataset:
    """Read one or more shards or folders of them as one data set; all parts know their bodies.

    Raises:
        DatasetError: nothing there, a damaged shard, a missing key, arrays that do not fit
            together, NaN or Inf; or a push that is in two of the folders.
    """
    sources = [(path, part) for path in paths for part in _by_bodies(path)]
    _check_apart(sources)
    hashes = tuple(dict.fromkeys(part.sha256 for _, part in sources))
    found = [part for _, part in sources]
    labelled = found if _labels_differ(found) else _relabelled(found)
    parts: dict[tuple[int, str, tuple[str, ...]], list[Dataset]] = {}
    for part in labelled:
        parts.setdefault(_order(part), []).append(part)
    identity = (hashes[0], ()) if len(hashes) == 1 else (_digest(hashes), hashes)
    joined = tuple(_joined(parts[key], *identity) for key in sorted(parts))
    return MixedDataset(joined, *identity)


def load_transitions(path: Path) -> Dataset:
    """Read a shard, or all of a folder in the order of their names, whose scenes are alike.

    Raises:
        DatasetError: see `load_datasets`; or scenes with different bodies.
    """
    parts = load_datasets([path]).parts
    if len(parts) > 1:
        names = "; ".join(", ".join(shape.name for shape in part.bodies.shapes) for part in parts)
        raise DatasetError(f"{path} mixes bodies: {names}; use one folder for each")
    return parts[0]


def split_datasets(
    data: Dataset | MixedDataset, seed: int, validation: float, test: float, transitions: int = 0
) -> Split | MixedSplit:
    """Split a data set so that no episode is in two parts; see `split_by_episode`.

    Raises:
        DatasetError: too few episodes or transitions.
    """
    if isinstance(data, Dataset):
        return split_by_episode(data, seed, validation, test, transitions)
    parts = draw_parts(data.episode, seed, validation, test)
    split = MixedSplit(*(data.select(rows) for rows in parts))
    if not transitions:
        return split
    validated = validation_share(len(split.train), len(split.validation), transitions)
    limited = _first(split.train, transitions), _first(split.validation, validated)
    return MixedSplit(*limited, split.test)


def _first(data: MixedDataset, count: int) -> MixedDataset:
    """Return so many pushes: episodes in order, the last one in part."""
    rows = np.zeros(len(data), dtype=bool)
    rows[np.lexsort((data.step, data.episode))[:count]] = True
    return data.select(rows)


def _by_bodies(path: Path) -> list[Dataset]:
    """Return what a folder holds by the bodies; scenes of as many have one SHA-256."""
    shards = [read_shard(shard) for shard in shard_paths(path)]
    found = []
    for count in sorted({shard[Column.STATE].shape[1] for shard in shards}):
        alike = [shard for shard in shards if shard[Column.STATE].shape[1] == count]
        whole = from_shards(path, alike)
        columns = (np.concatenate([shard[name] for shard in alike]) for name in SHAPED)
        names = np.array([";".join(row) for row in zip(*columns, strict=True)])
        for name in np.unique(names):
            bodies = bodies_named(*str(name).split(";"), whole.disks)
            found.append(replace(whole.select(names == name), bodies=bodies))
    return found


def _order(part: Dataset) -> tuple[int, str, tuple[str, ...]]:
    """Return what parts are put together and sorted by: disks by their number."""
    if part.bodies.are_paper_disks:
        return part.disks, "", ()
    first, *others = (shape.name for shape in part.bodies.shapes)
    return 0, f"{first}|{'|'.join(others)}", part.bodies.roles


def _labels_differ(parts: list[Dataset]) -> bool:
    """Return whether no two parts have an episode of the same label."""
    labels = [np.unique(part.episode) for part in parts]
    return len(np.unique(np.concatenate(labels))) == sum(map(len, labels))


def _relabelled(parts: list[Dataset]) -> list[Dataset]:
    """Return parts whose episodes have labels of their own."""
    labelled, first = [], 0
    for part in parts:
        names, labels = np.unique(part.episode, return_inverse=True)
        labelled.append(replace(part, episode=first + labels))
        first += len(names)
    return labelled


def _digest(hashes: tuple[str, ...]) -> str:
    return hashlib.sha256(" ".join(hashes).encode()).hexdigest()


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
