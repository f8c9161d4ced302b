"""Regular files, and nothing else: a FIFO has no end and a device may have effects."""

import os
import stat
from io import BufferedReader
from pathlib import Path
from typing import Final

from sain_core.errors import UntrustedFileError
from sain_core.untrusted.limits import WHOLE_BYTES

KINDS: Final = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def open_regular(path: Path) -> BufferedReader:
    """Open a file for reading; nothing is waited for.

    Raises:
        UntrustedFileError: it is no regular file.
        OSError: it does not exist, or may not be read.
    """
    refuse_special(path.stat().st_mode)  # opening a device may have effects
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    try:
        refuse_special(os.fstat(descriptor).st_mode)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def refuse_special(mode: int) -> None:
    """Raise `UntrustedFileError` where a file's mode is not that of a regular file."""
    if not stat.S_ISREG(mode):
        kind = KINDS.get(stat.S_IFMT(mode), "something else")
        raise UntrustedFileError(f"it is {kind}; only regular files are read")


def read_regular(path: Path, limit: int = WHOLE_BYTES) -> bytes:
    """Return the content of a file.

    Raises:
        UntrustedFileError: it is no regular file, or larger than the limit [bytes].
        OSError: it does not exist, or cannot be read.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > limit else file.read(limit + 1)
    if max(size, len(content)) > limit:
        raise UntrustedFileError(f"it has {max(size, len(content)):,} bytes; allowed: {limit:,}")
    return content


def read_regular_text(path: Path, limit: int = WHOLE_BYTES) -> str:
    """Return the text of a file; raises as `read_regular`, and where it is not UTF-8."""
    try:
        return read_regular(path, limit).decode()
    except UnicodeDecodeError as error:
        raise UntrustedFileError(f"it is not UTF-8 ({error.reason})") from error
