"""The files of a recording that was not closed, or that goes on with others: its parts.

Parts of earlier recordings stand beside the bag's folder, in ``BAG.cut_off``. Files are moved or
removed only where a folder holds nothing but what the recorder of this bag wrote.
"""

import re
import stat
from pathlib import Path
from typing import Final

from sain_bags.mcap.mcap_writer import BEGINNING
from sain_core.errors import OutputError

CUT_OFF: Final = ".cut_off"
BESIDE: Final = re.compile(  # what else a recorder has in its folder; it is gone from a whole bag
    r"\.nodes\.json|\.\.nodes\.json\.\d+\.partial|\.metadata\.yaml\.part|\..*_\d+\.mcap\.reserve"
)


def earlier(folder: Path) -> Path:
    """Return where the parts are of earlier recordings that this one goes on with."""
    folder = folder.absolute() if folder.name in ("", "..") else folder
    return folder.with_name(f"{folder.name}{CUT_OFF}")


def mcap_files(folder: Path) -> tuple[Path, ...]:
    """Return the MCAP files in a folder in their order; none where there is no folder."""
    found = folder.glob("*.mcap")
    return tuple(sorted(found, key=lambda path: (len(path.name), path.name)))


def check_parts(folder: Path, bag: str) -> None:
    """Check that all in a folder, if it is there, was written by the recorder of a bag.

    Raises:
        OutputError: it is no folder, or holds something else.
    """
    if not folder.exists() and not folder.is_symlink():
        return
    why = "it is no folder"
    if folder.is_dir() and not folder.is_symlink():
        others = [path.name for path in sorted(folder.iterdir()) if not _is_part(path, bag)]
        why = f"it holds {others[0]!r}" if others else ""
    if why:
        raise OutputError(
            f"{folder} is no recording that was cut off: {why}, and only the files of"
            f" a recorder, such as {bag}_0.mcap, may be there; choose another --out"
        )


def remove_parts(folder: Path, bag: str) -> None:
    """Remove a folder of parts."""
    check_parts(folder, bag)
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def set_aside(folder: Path) -> Path | None:
    """Make room for a bag where a recording was cut off; return where that is now, if any."""
    aside = earlier(folder)
    try:
        check_parts(aside, folder.name)
        check_parts(folder, folder.name)
        if folder.exists():
            move_files(folder, aside)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot go on with {folder}: {error.strerror or error}") from error
    return aside if aside.exists() else None


def move_files(folder: Path, aside: Path) -> None:
    """Move the files of a recording behind those that are aside already, and remove its folder."""
    aside.mkdir(exist_ok=True)
    numbers = [int(path.stem.rpartition("_")[2]) for path in mcap_files(aside)]
    for number, path in enumerate(mcap_files(folder), start=max(numbers, default=-1) + 1):
        path.rename(aside / f"{folder.name}_{number}.mcap")
    remove_parts(folder, folder.name)


def _is_part(path: Path, bag: str) -> bool:
    """Tell whether the recorder of a bag wrote a file, perhaps only its beginning."""
    if not stat.S_ISREG(path.lstat().st_mode):
        return False
    if not re.fullmatch(rf"{re.escape(bag)}_\d+\.mcap", path.name):
        return bool(BESIDE.fullmatch(path.name))
    with path.open("rb") as file:
        return BEGINNING.startswith(file.read(len(BEGINNING)))
