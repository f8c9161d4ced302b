"""Files that one process locks. The system releases a lock when its process ends, killed or not."""

import fcntl
import os
import time
from errno import EEXIST
from pathlib import Path
from stat import S_ISREG
from typing import Final

from sain_core.errors import OutputError, SainError

POLL_S: Final = 0.05
ENDING_S: Final = 1.0  # the longest that the end of a process takes that was killed


class LockedError(SainError):
    """A lock that another process holds; `holder` is its number and what it calls itself."""

    def __init__(self, holder: str) -> None:
        """Name the holder; empty: it has not written its name yet."""
        super().__init__(f"process {holder or 'without a name'} holds the lock")
        self.holder = holder


def lock_file(path: Path, owner: str) -> int:
    """Return a descriptor of a file that is locked until it is closed; made if need be.

    The file then says the number of this process and `owner`. Raises `LockedError`: another process
    holds the lock; `OutputError`: the file cannot be written.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags, 0o600)
        if not S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise FileExistsError(EEXIST, "it is no regular file; remove it")
        end = time.monotonic() + ENDING_S
        while not _is_locked(descriptor):
            if time.monotonic() >= end:
                holder = os.pread(descriptor, 300, 0).decode(errors="replace").strip()
                os.close(descriptor)
                raise LockedError(holder)
            time.sleep(POLL_S)
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()} ({owner})\n".encode(), 0)
    except OSError as error:
        raise OutputError(f"cannot lock {path}: {error.strerror}") from error
    return descriptor


def is_held(path: Path) -> bool:
    """Return True if another process holds the lock of a file."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        return not _is_locked(descriptor, fcntl.LOCK_SH)
    finally:
        os.close(descriptor)


def _is_locked(descriptor: int, kind: int = fcntl.LOCK_EX) -> bool:
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
