"""The files of a recording that was not closed.

They are changed only where a folder holds nothing but what the recorder of this bag wrote.
"""

import re
import stat
from pathlib import Path
from typing import Final

from mcap.data_stream import RecordBuilder
from mcap.records import Header
from mcap.well_known import Profile
from mcap.writer import MCAP0_MAGIC

from sain_core.errors import OutputError

HEADER: Final = RecordBuilder()
Header(Profile.ROS2, "sain_bags").write(HEADER)
BEGINNING: Final = MCAP0_MAGIC + HEADER.end()  # of each file
WHOLE: Final = ".whole"  # ends the name of a file's copy that is to replace it
BESIDE: Final = re.compile(  # what else a recorder has in its folder; it is gone from a whole bag
    r"\.nodes\.json|\.\.nodes\.json\.\d+\.partial|\.metadata\.yaml\.part"
    rf"|\..*_\d+\.mcap(\.reserve|{re.escape(WHOLE)})"
)


def mcap_files(folder: Path) -> tuple[Path, ...]:
    """Return the MCAP files in a folder in their order; none where there is no folder."""
    found = folder.glob("*.mcap")
    return tuple(sorted(found, key=lambda path: (len(path.name), path.name)))


def check_parts(folder: Path) -> None:
    """Check that all in a folder, if it is there, was written by the recorder of this bag.

    Raises:
        OutputError: it is no folder, or holds something else.
    """
    if not folder.exists() and not folder.is_symlink():
        return
    why = "it is no folder"
    if folder.is_dir() and not folder.is_symlink():
        others = [one.name for one in sorted(folder.iterdir()) if not _is_part(one, folder.name)]
        why = f"it holds {others[0]!r}" if others else ""
    if why:
        raise OutputError(
            f"{folder} is no recording that was cut off: {why}, and only the files of"
            f" a recorder, such as {folder.name}_0.mcap, may be there; choose another --out"
        )


def _is_part(path: Path, bag: str) -> bool:
    """Tell whether the recorder of a bag wrote a file, perhaps only its beginning."""
    if not stat.S_ISREG(path.lstat().st_mode):
        return False
    if not re.fullmatch(rf"{re.escape(bag)}_\d+\.mcap", path.name):
        return bool(BESIDE.fullmatch(path.name))
    with path.open("rb") as file:
        return BEGINNING.startswith(file.read(len(BEGINNING)))
