"""The log of a laboratory: lines that are only ever appended, each with its checksum.

A line is the CRC-32 of a JSON text in eight hexadecimal digits, a space, and that text. Where a
process was killed, the last line may be cut off: it counts for nothing, and the next owner of the
laboratory removes it. A damaged line before the last is an error.
"""

import json
import os
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.untrusted import MIB, open_regular, parse_json

FORMAT: Final = "sain-laboratory-log-1"
MOST_BYTES: Final = 4096 * MIB  # of a log; 10,000 pushes have 10
LONGEST_LINE: Final = MIB  # [bytes]; a push of two bodies has 1,000

Record = dict[str, Any]


def encoded(record: Record) -> bytes:
    """Return the line of a record."""
    text = json.dumps(record, separators=(",", ":"), allow_nan=False).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def decoded(line: bytes) -> Record | None:
    """Return the record of a line; None: it is not whole.

    Raises:
        UntrustedFileError: it is whole, and no record.
    """
    if not line.endswith(b"\n") or line[8:9] != b" ":
        return None
    text = line[9:-1]
    if line[:8] != b"%08x" % zlib.crc32(text):
        return None
    content = parse_json(text.decode())
    if not isinstance(content, dict) or "kind" not in content:
        raise UntrustedFileError("it is no record: it has no kind")
    return content


def read_log(path: Path) -> Iterator[tuple[Record, int]]:
    """Yield the records of a log, and the place [bytes] where each ends.

    Raises:
        DatasetError: no such file, of another version, too large, or a line is damaged.
    """
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size > MOST_BYTES:
                raise DatasetError(f"{path} has {size:,} bytes; allowed: {MOST_BYTES:,}")
            place = number = 0
            while line := file.readline(LONGEST_LINE + 1):
                record = decoded(line)
                if record is None:
                    if place + len(line) == size and len(line) <= LONGEST_LINE:
                        return  # cut off
                    raise DatasetError(
                        f"{path} is damaged: line {number + 1} does not have its checksum; copy the"
                        " laboratory again, or keep the lines before it"
                    )
                place, number = place + len(line), number + 1
                if number == 1:
                    _check_first(path, record)
                    continue
                yield record, place
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist; the laboratory was copied in part") from None
    except (OSError, UntrustedFileError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path} cannot be read: {error}") from error


def _check_first(path: Path, record: Record) -> None:
    if (found := record.get("format")) != FORMAT:
        raise DatasetError(f"{path} has the format {found!r}; this version reads {FORMAT!r}")


class LogTail:
    """Reads what its owner appends to a log, as it comes."""

    def __init__(self, path: Path) -> None:
        """Begin before the first record."""
        self._path, self._place = path, 0

    def read(self) -> Iterator[Record]:
        """Yield the records that came since the last time.

        Raises:
            OSError, UntrustedFileError: the log cannot be read.
        """
        with open_regular(self._path) as file:
            file.seek(self._place)
            while line := file.readline(LONGEST_LINE + 1):
                record = decoded(line)
                if record is None:
                    return  # it is being written
                self._place += len(line)
                if record["kind"] != "log":
                    yield record


class LogWriter:
    """Appends records; each is on the disk when `append` returns."""

    def __init__(self, path: Path) -> None:
        """Go on behind the last whole line; begin the log where there is none.

        Raises:
            OutputError: the file cannot be written.
            DatasetError: the log is damaged.
        """
        self._path = path
        if not path.exists() or path.stat().st_size == 0:
            self.size = 0
        else:
            self.size = len(_first_line(path))
            for _, place in read_log(path):
                self.size = place
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            self._file = os.open(path, flags, 0o644)
            os.ftruncate(self._file, self.size)
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
        if self.size == 0:
            self.append({"kind": "log", "format": FORMAT})

    def append(self, record: Record) -> None:
        """Append a record: whole, or not at all.

        Raises:
            OutputError: the disk is full, or the log has reached its largest size.
        """
        line = encoded(record)
        try:
            if len(line) > LONGEST_LINE or self.size + len(line) > MOST_BYTES:
                raise OSError(f"a record of {len(line):,} bytes is beyond the limits of a log")
            written = 0
            while written < len(line):
                written += os.pwrite(self._file, line[written:], self.size + written)
            os.fdatasync(self._file)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
            raise OutputError(f"cannot write {self._path}: {error.strerror or error}") from error
        self.size += len(line)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def _first_line(path: Path) -> bytes:
    """Return the first line of a log, empty where it was cut off."""
    with open_regular(path) as file:
        line = file.readline(LONGEST_LINE)
    record = decoded(line)
    if record is None:
        return b""
    _check_first(path, record)
    return line
