"""A data set in a format other than npz: written completely, then moved into place."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from sain_bags.dataset.formats import MADE, FormatName, StoredRows, Write
from sain_core.errors import OutputError
from sain_core.guarding.untrusted import PARTIAL
from sain_core.output import MANIFEST, claim_file, is_ours, remove, sign

EXPORT: Final = f".export{PARTIAL}"  # where it stands until it is whole
DISKS: Final = "disks-"  # with a number: folders of data sets, where numbers of disks differ


def export(
    write: Write,
    folder: Path,
    shards: Mapping[int, Sequence[Path]],
    parts: dict[str, frozenset[int]],
    card: dict[str, Any],
    advance: Callable[[int], None],
) -> None:
    """Write gathered rows in another format: one data set for each number of disks.

    A single data set is put into the folder, several into ``disks-N`` below. `advance` is called
    with the number of further rows written.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    partial = folder / EXPORT
    with _writing(folder), _removed_after_error(partial):
        if len(shards) > 1:
            partial.mkdir()
        for disks, paths in shards.items():
            name = folder.name if len(shards) == 1 else f"{DISKS}{disks}"
            rows = StoredRows(name, disks, tuple(paths), parts, card, advance)
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
