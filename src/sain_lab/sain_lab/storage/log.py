"""The log of a laboratory: lines that are only ever appended, each with its checksum.

A line is the CRC-32 of a JSON text in eight hexadecimal digits, a space, and that text. Where a
process was killed, the last line may be cut off: it counts for nothing, and the next owner of the
laboratory removes it. A damaged line stays in the file: it is named, and the lines after it count.

Decisions of a learner, and what it noticed.
"""

import json
import os
import re
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Final, Self

from sain_core.errors import DatasetError, OutputError, SainError, UntrustedFileError
from sain_core.guarding.documents import parse_json
from sain_core.guarding.untrusted import MIB, is_file, open_regular
from sain_core.provenance import FORMAT, other_format

TRAINING, TRAINED, FAILED = "training", "trained", "training failed"
LOADED, DROPPED = "loaded", "dropped"
JUMPED: Final = "table changed"
NOT_LEARNED: Final = "not learned"
NOT_PREDICTED: Final = "not predicted"
LEFT_OUT: Final = "left out"
NOT_REMOVED: Final = "not removed"


@dataclass(frozen=True)
class Event:
    """A decision, or something that was noticed."""

    kind: str  # one of those above
    text: str  # for people
    pushes: int = 0  # learned from so far
    time: float = 0.0  # seconds since 1970
    about: Mapping[str, Any] = field(default_factory=dict)  # more, by name

    def record(self) -> dict[str, Any]:
        """Return it as the log has it."""
        content = {name: value for name, value in vars(self).items() if name != "kind"}
        return {"kind": "event", "event": self.kind, **content, "about": dict(self.about)}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """Return what `record` made."""
        own = {name: record[name] for name in ("text", "pushes", "time", "about")}
        if not isinstance(record["event"], str) or not isinstance(own["text"], str):
            raise TypeError(f"event is {record['event']!r}, text is {own['text']!r}")
        return cls(record["event"], **own)


MOST_BYTES: Final = 4096 * MIB  # of a log; 10,000 pushes have 10
LONGEST_LINE: Final = MIB  # [bytes]; a push of two bodies has 1,000
OF_A_PUSH: Final = (b'"kind":"push"', b'"digest":', b'"before":')  # a flipped bit leaves two
BEGINNING: Final = re.compile(rb"[0-9a-f]{0,8}|[0-9a-f]{8} (\{.*)?", re.DOTALL)  # of a line

Record = dict[str, Any]
FIRST: Final[Record] = {"kind": "log", "format": FORMAT}


def encoded(record: Record) -> bytes:
    """Return the line of a record."""
    text = json.dumps(record, separators=(",", ":"), allow_nan=False).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def decoded(line: bytes) -> Record:
    """Return the record of a line.

    Raises `UntrustedFileError` or `ValueError`: it does not have its checksum, or is no record.
    """
    text = line[9:-1]
    if not line.endswith(b"\n") or line[:9] != b"%08x " % zlib.crc32(text):
        raise UntrustedFileError("CRC")
    content = parse_json(text.decode())
    if not isinstance(content, dict) or not isinstance(content.get("kind"), str):
        raise UntrustedFileError("no record: it has no kind")
    return content


class LogReader:
    """Reads a log, and later what its owner has appended.

    Attributes:
        place: where the last line ends that was read [bytes].
        damage: a sentence for each damaged line so far.
    """

    def __init__(self, path: Path, check: Callable[[Record], object] = lambda _: None) -> None:
        self._path, self._check, self._lines = path, check, 0
        self.place = 0
        self.damage: list[str] = []

    def read(self) -> Iterator[Record]:
        """Yield the records since the last time.

        Raises `DatasetError`: no such file, too large, or of another version.
        """
        try:
            with open_regular(self._path) as file:
                self._check_size(os.fstat(file.fileno()).st_size)
                file.seek(self.place)
                while (line := _next_line(file)) and not _is_cut_off(line):
                    self.place, self._lines = file.tell(), self._lines + 1
                    if record := self._record(line):
                        yield record
        except FileNotFoundError:
            raise DatasetError(
                f"{self._path} does not exist; the laboratory was copied in part"
            ) from None
        except (OSError, UntrustedFileError) as error:
            raise DatasetError(f"{self._path} cannot be read: {error}") from error

    def _check_size(self, size: int) -> None:
        if size > MOST_BYTES:
            raise DatasetError(f"{self._path} has {size:,} bytes; allowed: {MOST_BYTES:,}")

    def _record(self, line: bytes) -> Record | None:
        """Return the record of a line; None: the line is damaged, or states the format."""
        try:
            record = decoded(line)
            if record["kind"] != "log":
                self._check(record)
                return record
        except (SainError, LookupError, TypeError, ValueError, AttributeError) as error:
            reason = f"it has no {error}" if isinstance(error, KeyError) else error
            self.damage.append(
                f"line {self._lines} of {self._path} is damaged ({reason}); {_missing(line)}"
            )
            return None
        if wrong := other_format(record.get("format"), "begin another laboratory"):
            raise DatasetError(f"{self._path} {wrong}")
        return None


def _next_line(file: IO[bytes]) -> bytes:
    """Return the next line; of one that is too long the end, which is no record either."""
    line = file.readline(LONGEST_LINE)
    while len(line) == LONGEST_LINE and not line.endswith(b"\n"):
        line = file.readline(LONGEST_LINE)
    return line


def _is_cut_off(line: bytes) -> bool:
    """Return True if the end of a line was never written, and not its last byte damaged."""
    return not line.endswith(b"\n") and line[:8] != b"%08x" % zlib.crc32(line[9:-1])


def _missing(line: bytes) -> str:
    """Return what is missing with a damaged line."""
    pushes = max(line.count(word) for word in OF_A_PUSH)
    if pushes == 0:
        return "no push is missing, but a decision, a belief or the end of an episode"
    return "1 push is missing" if pushes == 1 else f"{pushes} pushes are missing"


class LogWriter:
    """Appends records; each is on the disk when `append` returns."""

    def __init__(self, path: Path, durable: bool = True) -> None:
        """Go on behind the last line that is not cut off; begin the log where there is none.

        Args:
            path: of the log.
            durable: whether a record outlives the machine, and not the process alone.

        Raises:
            OutputError: the file cannot be written.
            DatasetError: it is no log, or one of another version.
        """
        self._path, self._durable = path, durable
        self.size = self._end() if is_file(path) else 0
        try:
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            self._file = os.open(path, flags, 0o644)
            os.ftruncate(self._file, self.size)
            if self.size and os.pread(self._file, 1, self.size - 1) != b"\n":
                self.size += os.pwrite(self._file, b"\n", self.size)
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
        if self.size == 0:
            self.append(FIRST)

    def _end(self) -> int:
        """Return where the lines end that stay."""
        reader = LogReader(self._path)
        for _ in reader.read():
            pass
        with open_regular(self._path) as file:
            file.seek(reader.place)
            if not BEGINNING.fullmatch(file.read(LONGEST_LINE + 1)):
                raise DatasetError(
                    f"{self._path} is no log of a laboratory from byte {reader.place} on; move it"
                    " away, or copy the laboratory again"
                )
        return reader.place

    def append(self, record: Record) -> None:
        """Append a record: whole, or not at all.

        Raises `OutputError`: the disk is full, or the log has reached its largest size.
        """
        line = encoded(record)
        try:
            if len(line) > LONGEST_LINE or self.size + len(line) > MOST_BYTES:
                raise OSError(f"a record of {len(line):,} bytes is beyond the limits of a log")
            written = 0
            while written < len(line):
                written += os.pwrite(self._file, line[written:], self.size + written)
            if self._durable:
                os.fdatasync(self._file)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
            raise OutputError(f"cannot write {self._path}: {error.strerror or error}") from error
        self.size += len(line)

    def clear(self) -> None:
        """Remove all records, which count elsewhere."""
        if self.size > len(encoded(FIRST)):
            os.ftruncate(self._file, 0)
            self.size = 0
            self.append(FIRST)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)
