"""A recording that a crash has cut off, and the one that goes on with it, become one bag."""

import shutil
from pathlib import Path
from typing import Final

from sain_bags.bag.metadata import METADATA_FILE
from sain_bags.recovery.recovery import recover
from sain_core.errors import OutputError

CUT_OFF: Final = "cut_off"  # suffix of a folder with the files of recordings that were cut off


def set_aside(folder: Path) -> Path | None:
    """Make room for a bag where a recording was cut off; return where that is now; None: nowhere.

    Raises:
        OutputError: there is a whole bag, or something else that is no recording.
    """
    aside = folder.with_name(f"{folder.name}.{CUT_OFF}")
    if not folder.exists():
        return aside if aside.exists() else None
    if not folder.is_dir() or (folder / METADATA_FILE).exists():
        raise OutputError(f"{folder} is no recording that was cut off; choose another --out")
    try:
        _move_files(folder, aside)
    except OSError as error:
        raise OutputError(f"cannot go on with {folder}: {error.strerror or error}") from error
    return aside


def join(aside: Path, folder: Path) -> None:
    """Put what was set aside before a bag that went on with it.

    Raises:
        OutputError, DatasetError: it fails; all that was recorded is still there.
    """
    try:
        (folder / METADATA_FILE).unlink(missing_ok=True)
        _move_files(folder, aside)
    except OSError as error:
        raise OutputError(f"cannot join {aside} and {folder}: {error.strerror or error}") from error
    recover(aside, folder)
    shutil.rmtree(aside)


def _move_files(folder: Path, aside: Path) -> None:
    """Move the files of a bag behind those that are aside already, and remove its folder."""
    aside.mkdir(exist_ok=True)
    count = len(list(aside.glob("*.mcap")))
    files = sorted(folder.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    for number, path in enumerate(files, start=count):
        path.rename(aside / f"{folder.name}_{number}.mcap")
    shutil.rmtree(folder)
