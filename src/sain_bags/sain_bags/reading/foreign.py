"""Files of bags that cannot be read as they are: copied, for as long as the bag is read.

These are sqlite3 files, what rosbag2 compressed, and MCAP files without chunks or indexes.
"""

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import zstandard
from mcap.exceptions import McapError
from mcap.records import Chunk, McapRecord, Message
from mcap.stream_reader import breakup_chunk

from sain_bags.mcap.copying import McapCopy
from sain_bags.mcap.integrity import Unpacking, opened, read_data, unpack
from sain_bags.mcap.mcap_file import McapFile
from sain_bags.reading.sqlite_file import read_sqlite
from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import PIECE_BYTES, open_regular

UNCOMPRESSED: Final = ("", "none")
BAD_CONTENT: Final = (sqlite3.Error, LookupError, TypeError, ValueError, AttributeError)
STORAGES: Final = ("mcap", "sqlite3")
WINDOW: Final = 1 << 20  # [bytes], unpacked at a time


class ReadableFiles:
    """The files of a bag as indexed MCAP files; copies are deleted with this."""

    def __init__(self, metadata: Mapping[str, Any], files: Sequence[Path]) -> None:
        """Copy what must be copied."""
        self._storage = str(metadata.get("storage_identifier") or "mcap")
        self._mode = str(metadata.get("compression_mode") or "").lower()
        if self._storage not in STORAGES:
            raise DatasetError(
                f"{files[0]} is of the storage {self._storage[:40]!r};"
                f" allowed: {', '.join(STORAGES)}"
            )
        if self._mode not in UNCOMPRESSED and metadata.get("compression_format") != "zstd":
            raise DatasetError(f"{files[0]} is compressed; only zstd can be read")
        self._place: TemporaryDirectory[str] | None = None
        try:
            self.files = [self._readable(file) for file in files]
        except BaseException:
            if self._place is not None:
                self._place.cleanup()
            raise

    def _readable(self, file: Path) -> McapFile:
        source = self._unpacked(file) if self._mode == "file" else file
        if self._storage == "sqlite3":
            return self._copy(file, self._read_sqlite(file, source))
        found = McapFile(source)
        if found.is_indexed and self._mode != "message":
            return found
        with opened(source) as stream:
            copy = self._copy(file, read_data(stream))
            if copy.statistics.message_count != (stated := found.statistics.message_count):
                number = copy.statistics.message_count
                raise McapError(f"{number} messages were found, instead of {stated}")
        copy.has_crcs = found.has_crcs
        return copy

    def _copy(self, file: Path, records: Iterable[McapRecord]) -> McapFile:
        path = self._folder / f"{file.name}.copy"
        unpacking = Unpacking(file.stat().st_size)
        with path.open("wb") as stream:
            copy = McapCopy(stream)
            for record in records:
                for one in breakup_chunk(record) if isinstance(record, Chunk) else (record,):
                    if self._mode == "message" and isinstance(one, Message):
                        one.data = _unpack_message(one.data, unpacking, file)
                    copy.add(one)
            copy.writer.finish()
        made = McapFile(path)
        made.has_crcs = False  # of the original
        return made

    def _read_sqlite(self, file: Path, source: Path) -> Iterator[McapRecord]:
        try:
            yield from read_sqlite(source, self._folder)
        except (*BAD_CONTENT, UntrustedFileError) as error:
            reason = " ".join(str(error).split())
            raise DatasetError(f"{file} cannot be read: {reason}; get the bag again") from error

    def _unpacked(self, source: Path) -> Path:
        """Return a copy of a file that rosbag2 compressed, decompressed."""
        target = self._folder / source.stem
        try:
            unpacking = Unpacking(source.stat().st_size)
            with open_regular(source) as stream, target.open("wb") as file:
                reader = zstandard.ZstdDecompressor(max_window_size=PIECE_BYTES).stream_reader(
                    stream
                )
                while part := reader.read(WINDOW):
                    unpacking.take(len(part))
                    file.write(part)
        except (OSError, UntrustedFileError, zstandard.ZstdError) as error:
            raise DatasetError(f"{source} cannot be unpacked: {error}") from error
        return target

    @property
    def _folder(self) -> Path:
        self._place = self._place or TemporaryDirectory(prefix="sain_bags-")
        return Path(self._place.name)


def _unpack_message(data: bytes, unpacking: Unpacking, source: Path) -> bytes:
    try:
        found = bytes(unpack("zstd", data, PIECE_BYTES))
        unpacking.take(len(found))
    except (DatasetError, MemoryError, zstandard.ZstdError) as error:
        raise DatasetError(f"a message in {source} cannot be unpacked: {error}") from error
    return found
