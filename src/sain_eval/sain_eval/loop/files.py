"""Output folders: checked before the work."""

from pathlib import Path
from tempfile import NamedTemporaryFile

from sain_core.errors import OutputError


def output_folder(folder: Path) -> Path:
    """Return the folder, made if need be, once a file could be written there.

    Raises:
        OutputError: it is a file, cannot be made or cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with NamedTemporaryFile(dir=folder, prefix=".probe-"):
            pass
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(f"cannot write to {folder}: {reason}; choose another --out") from error
    return folder
