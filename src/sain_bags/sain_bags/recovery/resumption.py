"""A recording that a crash has cut off, and the one that goes on with it, become one bag."""

from collections.abc import Callable
from pathlib import Path

from sain_bags.bag.parts import check_parts, earlier, mcap_files, remove_parts
from sain_bags.recovery.recovery import recover
from sain_bags.recovery.recovery_report import RecoveryOutcome
from sain_core.errors import OutputError


def set_aside(folder: Path) -> Path | None:
    """Make room for a bag where a recording was cut off; return where that is now; None: nowhere.

    Raises:
        OutputError: there is a whole bag, or something else that is no recording.
    """
    aside = earlier(folder)
    try:
        check_parts(aside, folder.name)
        check_parts(folder, folder.name)
        if folder.exists():
            _move_files(folder, aside)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot go on with {folder}: {error.strerror or error}") from error
    return aside if aside.exists() else None


def join(aside: Path, folder: Path, advance: Callable[[int], object] = lambda done: None) -> None:
    """Put what was set aside before a recording that went on with it and wrote no metadata.

    `advance` is called with the number of bytes that were read, after each record.

    Raises:
        OutputError, DatasetError: it fails; all that was recorded is still there.
    """
    try:
        check_parts(folder, folder.name)
        _move_files(folder, aside)
        report = recover(aside, folder, advance)
        if report.outcome == RecoveryOutcome.NOTHING:
            raise OutputError(f"there is no message in the parts in {aside}; they are left")
        remove_parts(aside, folder.name)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot join {aside} and {folder}: {error.strerror or error}") from error


def _move_files(folder: Path, aside: Path) -> None:
    """Move the files of a recording behind those that are aside already, and remove its folder."""
    aside.mkdir(exist_ok=True)
    numbers = [int(path.stem.rpartition("_")[2]) for path in mcap_files(aside)]
    for number, path in enumerate(mcap_files(folder), start=max(numbers, default=-1) + 1):
        path.rename(aside / f"{folder.name}_{number}.mcap")
    remove_parts(folder, folder.name)
