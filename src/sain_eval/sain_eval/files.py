"""Output folders and files: checked before the work, written whole or not at all."""

import os
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


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file under a temporary name and rename it when it is whole.

    Raises:
        OutputError: it cannot be written; what was there before is untouched.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
    return path
