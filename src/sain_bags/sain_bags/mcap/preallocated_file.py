"""A file that can still be finished when the disk runs full."""

import errno
import os
from pathlib import Path
from typing import Final

RESERVE: Final = 1 << 20  # [bytes], a chunk, its index and a long bag's summary fit in
FULL: Final = (errno.ENOSPC, errno.EDQUOT)


class PreallocatedFile:
    """A new binary file for writing that keeps some space back.

    When a write finds the disk full, the space kept back is given up, the write goes on, and
    `full` is set: the owner then has room for what makes the file whole, and should stop.
    """

    def __init__(self, path: Path, reserve: int = RESERVE) -> None:
        """Create a file that must not exist, and ``reserve`` bytes beside it."""
        self.path = path
        self.full = False
        self._reserve_path = path.with_name(f".{path.name}.reserve")
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        try:
            self._take_reserve(reserve)
        except OSError:
            os.close(self._descriptor)
            path.unlink()
            raise

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Write all of the data, giving up the reserve when there is no space left."""
        rest = memoryview(data)
        while rest:
            try:
                rest = rest[os.write(self._descriptor, rest) :]
            except OSError as error:
                if error.errno not in FULL or self.full:
                    raise
                self.full = True
                self._reserve_path.unlink()
        return len(data)

    def truncate(self, size: int) -> None:
        """Cut the file off here, and go on writing here."""
        os.ftruncate(self._descriptor, size)
        os.lseek(self._descriptor, size, os.SEEK_SET)

    def close(self) -> None:
        """Make sure that the data is on the disk, and give the reserve back."""
        try:
            os.fsync(self._descriptor)
        finally:
            os.close(self._descriptor)
            self._reserve_path.unlink(missing_ok=True)

    def _take_reserve(self, size: int) -> None:
        descriptor = os.open(self._reserve_path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        try:
            os.posix_fallocate(descriptor, 0, size)
        except OSError:
            self._reserve_path.unlink()
            raise
        finally:
            os.close(descriptor)
