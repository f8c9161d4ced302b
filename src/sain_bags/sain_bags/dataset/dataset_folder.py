"""The folder that a data set is written to.

``conversion.json`` is written before the first shard and says which conversion the folder belongs
to; ``card.json`` is written last, and where it stands the data set is whole. Rows of any format
are gathered as npz shards, which makes every conversion one to go on with.
"""

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_bags.dataset.formats import MADE, SHARDS, FormatName, StoredRows, Write, find_format
from sain_bags.dataset.formats.stored_rows import FindImage, no_image
from sain_core.errors import DatasetError, OutputError
from sain_core.guarding.documents import read_json
from sain_core.guarding.untrusted import PARTIAL
from sain_core.output import (
    LEFT_OVER,
    MANIFEST,
    claim_file,
    claim_folder,
    is_ours,
    remove,
    sign,
    write_json,
)
from sain_core.shapes.outlines import OUTLINES_FILE
from sain_core.storage import read_arrays, write_arrays
from sain_core.transitions import (
    PARTS,
    SEED,
    SHARD_PATTERN,
    SHARES,
    TRAIN,
    Column,
    Columns,
    draw_parts,
    shard_path,
)

IDENTITY_FILE: Final = "conversion.json"
CARD_FILE: Final = "card.json"
GATHERED: Final = ".rows"  # folder of the shards until they are written in another format
EXPORT: Final = f".export{PARTIAL}"  # where another format stands until it is whole
DISKS: Final = "disks-"  # with a number: folders of data sets, where numbers of disks differ

CardContent = dict[str, Any]
Episodes = dict[str, frozenset[int]]  # by part of the split
Counts = Mapping[tuple[int, int], int]  # of rows, by number of disks and episode


class DatasetFolder:
    """Writes the shards and the card of one conversion."""

    def __init__(self, path: Path, identity: CardContent, overwrite: bool = False) -> None:
        """Check the folder; nothing is written or deleted before the first shard.

        Args:
            path: a new or empty folder, or that of a conversion.
            identity: what makes two conversions the same, the format among it; as JSON would
                give it back.
            overwrite: make anew what a conversion made there.

        Raises:
            ConfigError: the format's library is not installed.
            OutputError: it holds something else, or another conversion and is not to be
                overwritten.
        """
        self.path, self._identity = path, identity
        self._write = find_format(identity["format"])
        self._gathered = path / GATHERED if self._write else path
        self._overwrite, self._begun = overwrite, False
        self._shards: dict[int, list[Path]] = {}  # by the number of disks
        self._counts: Counter[tuple[int, int]] = Counter()  # rows, by that and episode
        self._names = (CARD_FILE, IDENTITY_FILE, OUTLINES_FILE, SHARD_PATTERN)
        self._found = found = _read_identity(path)
        claim_folder(path, (*self._names, *MADE[identity["format"]]), overwrite)
        if found is not None and found != identity and not overwrite:
            raise OutputError(
                f"{path} holds another conversion ({_difference(found, identity)}); choose another"
                " folder, or --overwrite"
            )

    def store(self, columns: Columns) -> Columns:
        """Write columns as the next shard, unless it is there already; return them."""
        if not self._begun:
            self._begin()
        disks, index = columns[Column.MASSES].shape[1], sum(map(len, self._shards.values()))
        stored = write_shard(self._gathered, index, columns)
        self._shards.setdefault(disks, []).append(shard_path(self._gathered, index))
        episodes, counts = np.unique(columns[Column.EPISODE], return_counts=True)
        for episode, count in zip(episodes, counts, strict=True):
            self._counts[disks, int(episode)] += int(count)
        return stored

    def finish(
        self,
        card: CardContent,
        progress: Callable[[int, int], None] = lambda rows, of: None,
        image: FindImage = no_image,
    ) -> None:
        """Write the rows in the format, then the card, which completes the data set.

        `progress` is called with the number of rows written, and of all; `image` returns one.
        After an error nothing is left of a format other than npz; after a stop, the gathered rows.
        """
        parts = split_episodes(self._counts)
        card = {**card, "split": describe_split(parts, self._counts)}
        if self._write:
            written = 0

            def advance(rows: int) -> None:
                nonlocal written
                written += rows
                progress(written, self._counts.total())

            try:
                export(self._write, self.path, self._shards, parts, card, advance, image)
                put_in_place(self.path, self._identity["format"])
            except Exception:
                self._remove_gathered()
                if {path.name for path in self.path.iterdir()} <= {IDENTITY_FILE, MANIFEST}:
                    remove_files(self.path, IDENTITY_FILE, self.path)
                raise
            self._remove_gathered()
        write_json(self.path / CARD_FILE, card)

    def _remove_gathered(self) -> None:
        remove_files(self.path / GATHERED, SHARD_PATTERN, self.path)

    def _begin(self) -> None:
        if self._overwrite:
            self._remove_gathered()
        if self._overwrite and self._found is not None:
            clear(self.path, self._found.get("format", SHARDS))
        for name in (CARD_FILE, OUTLINES_FILE):
            remove_files(self.path, name, self.path)
        write_json(self.path / IDENTITY_FILE, self._identity)
        self._begun = True


def write_shard(folder: Path, index: int, arrays: Columns) -> Columns:
    """Write columns as a shard, whole or not at all, unless it is there already; return them."""
    path = shard_path(folder, index)
    if not path.exists():
        write_arrays(path, arrays, deflate_numbers=False)
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


def _read_identity(folder: Path) -> CardContent | None:
    """Return the identity of the conversion in a folder; None: the folder is new or empty."""
    path = folder / IDENTITY_FILE
    try:
        entries = {one.name for one in folder.iterdir()} if folder.exists() else set()
        if not {one for one in entries if not LEFT_OVER.fullmatch(one)} - {MANIFEST}:
            return None
        content = read_json(path)
    except NotADirectoryError as error:
        raise OutputError(f"{folder} is a file; choose a folder") from error
    except FileNotFoundError as error:
        raise OutputError(
            f"{folder} holds files, and no {IDENTITY_FILE} says that a conversion made them;"
            " choose another folder"
        ) from error
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} cannot be read ({error}); choose another folder") from error
    if not isinstance(content, dict):
        raise OutputError(f"{path} is damaged; choose another folder")
    return content


def _difference(found: CardContent, wanted: CardContent) -> str:
    name = next(key for key in {**wanted, **found} if found.get(key) != wanted.get(key))
    if name == "bags":  # hashes name no recording
        return "of other recordings"
    return f"{name} = {found.get(name)!r}, not {wanted.get(name)!r}"


def split_episodes(counts: Counts) -> Episodes:
    """Split as `sain_model train` does by default; too few episodes are all for training."""
    labels = [episode for _, episode in sorted(counts)]
    try:
        masks = draw_parts(np.arange(len(labels)), SEED, *SHARES.values())
    except DatasetError:
        drawn = [TRAIN] * len(labels)
    else:
        drawn = np.select(masks, PARTS, "").tolist()
    parts: dict[int, str] = {}
    for episode, part in zip(labels, drawn, strict=True):
        parts.setdefault(episode, part)  # where disks came or went it stands there twice
    return {
        part: frozenset(episode for episode in parts if parts[episode] == part) for part in PARTS
    }


def describe_split(episodes: Episodes, counts: Counts) -> dict[str, Any]:
    """Return the split for the card; episodes that it does not name are for training."""
    rows = {
        part: sum(count for (_, episode), count in counts.items() if episode in episodes[part])
        for part in PARTS
    }
    named = {part: sorted(episodes[part]) for part in PARTS if part != TRAIN}
    return {"seed": SEED, "shares": SHARES, "transitions": rows, "episodes": named}


def export(
    write: Write,
    folder: Path,
    shards: Mapping[int, Sequence[Path]],
    parts: dict[str, frozenset[int]],
    card: dict[str, Any],
    advance: Callable[[int], None],
    image: FindImage = no_image,
) -> None:
    """Write gathered rows in another format: one data set for each number of disks.

    A single data set is put into the folder, several into ``disks-N`` below. `advance` is called
    with the number of further rows written.
    """
    partial = folder / EXPORT
    with _writing(folder), _removed_after_error(partial):
        if len(shards) > 1:
            partial.mkdir()
        for disks, paths in shards.items():
            name = folder.name if len(shards) == 1 else f"{DISKS}{disks}"
            rows = StoredRows(name, disks, tuple(paths), parts, card, advance, image)
            write(rows, partial if len(shards) == 1 else partial / name)
        for path in partial.rglob("*"):
            if path.is_file():
                _keep(path)


def put_in_place(folder: Path, name: FormatName) -> None:
    """Replace an earlier data set by the exported one; raises `OutputError`."""
    clear(folder, name)
    partial = folder / EXPORT
    with _writing(folder):
        for path in filter(Path.is_file, partial.rglob("*")):
            place = folder / path.relative_to(partial)
            place.parent.mkdir(parents=True, exist_ok=True)
            claim_file(place)
            path.replace(place)
            sign(place)
        remove(partial)


def clear(folder: Path, name: FormatName) -> None:
    """Remove the files of a data set in a format, and nothing else; raises `OutputError`."""
    with _writing(folder):
        for pattern in MADE.get(name, ()):
            for place in (folder, *folder.glob(f"{DISKS}[0-9]*")):
                remove_files(place, pattern, folder)


def remove_files(folder: Path, pattern: str, top: Path) -> None:
    """Remove our files of a pattern, and the folders up to `top` that are empty then."""
    for path in filter(is_ours, sorted(folder.glob(pattern))):
        remove(path)
        for parent in path.parents:
            if parent == top or {one.name for one in parent.iterdir()} - {MANIFEST}:
                break
            remove(parent)


@contextmanager
def _removed_after_error(partial: Path) -> Iterator[None]:
    """Begin without what an earlier run left, and leave nothing after an error or a stop."""
    sign(partial / "*", grows=True)
    remove(partial)
    try:
        yield
    except BaseException:
        with suppress(OutputError):
            remove(partial)
        raise


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {folder}: {error.strerror or error}") from error


def _keep(path: Path) -> None:
    """Write a file through to the disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
