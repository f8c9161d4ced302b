"""Damage to an MCAP file: its data and its summary read so that no damage passes for data.

Format: https://mcap.dev/spec.
"""

import shlex
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import RecordBuilder
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import SeekingReader
from mcap.records import Attachment, Chunk, DataEnd, Footer, McapRecord
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import (
    NAME_LENGTH,
    PIECE_BYTES,
    SUMMARY_BYTES,
    TOPICS,
    limit,
    most_messages,
    open_regular,
    unpacked_bytes,
)

FOOTER_SIZE: Final = 1 + 8 + 8 + 8  # [bytes], opcode, length and the footer but its CRC
TAIL_SIZE: Final = FOOTER_SIZE + 4 + 8  # with the CRC and the closing magic
CRC_SIZE: Final = 4  # [bytes], at the end of the data and of an attachment

DAMAGE: Final = (
    McapError,
    ValueError,  # mcap's CRC errors and bad text
    struct.error,
    EOFError,
    KeyError,
    IndexError,
    MemoryError,
    RuntimeError,  # lz4
    OverflowError,  # a length of 64 bits
    zstandard.ZstdError,
)
METADATA_FILE: Final = "metadata.yaml"  # beside the files of a bag


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a file; what goes wrong with it inside becomes a `DatasetError` that names it."""
    try:
        with open_regular(path) as stream:
            yield stream
    except OSError as error:
        raise DatasetError(f"{path} cannot be read: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    except (DatasetError, *DAMAGE) as error:
        reason = str(error) or type(error).__name__
        bag = path.parent if (path.parent / METADATA_FILE).is_file() else path
        raise DatasetError(f"{path} is damaged or not whole ({reason}); {rescue(bag)}") from error


def rescue(bag: Path) -> str:
    """Return, as text, the command that saves what a damaged or unfinished bag holds."""
    bag = bag.absolute() if bag.name in ("", "..") else bag
    new = bag.with_name(f"{bag.name.removesuffix('.mcap')}_saved")
    command = shlex.join(["recover", str(bag), "--out", str(new)])
    return f"`ros2 run sain_bags {command}` copies what can be read"


def read_summary(stream: IO[bytes]) -> Summary:
    """Read the summary of a file, after comparing its CRC, which mcap's readers leave unchecked.

    Raises:
        McapError: there is none, or it is damaged.
        UntrustedFileError: it states more than is allowed.
    """
    size = stream.seek(0, 2)
    if size < TAIL_SIZE:
        raise McapError("it ends too early")
    stream.seek(size - len(MCAP0_MAGIC))
    if stream.read() != MCAP0_MAGIC:
        raise McapError("its end is missing")
    stream.seek(size - TAIL_SIZE)
    reader = StreamReader(stream, skip_magic=True, record_size_limit=TAIL_SIZE)
    footer = next(iter(reader.records), None)
    if not isinstance(footer, Footer) or not 0 < footer.summary_start <= size - TAIL_SIZE:
        raise McapError("it has no summary")
    limit("bytes in its summary", size - footer.summary_start, SUMMARY_BYTES)
    stream.seek(footer.summary_start)
    content = stream.read(size - TAIL_SIZE + FOOTER_SIZE - footer.summary_start)
    if footer.summary_crc and zlib.crc32(content) != footer.summary_crc:
        raise McapError("its summary does not match its CRC")
    stream.seek(0)
    summary = SeekingReader(stream, record_size_limit=SUMMARY_BYTES).get_summary()
    if summary is None or summary.statistics is None:
        raise McapError("it has no summary")
    limit("messages", summary.statistics.message_count, most_messages(size))
    limit("topics", len(summary.channels), TOPICS)
    names = [one.topic for one in summary.channels.values()]
    names += [one.name for one in summary.schemas.values()]
    limit("characters in a name", max(map(len, names), default=0), NAME_LENGTH)
    return summary


class Unpacking:
    """Counts what a file unpacks to: a small one that holds much is not unpacked."""

    def __init__(self, size: int) -> None:
        """Begin for a file of this size [bytes]."""
        self._allowed = self._left = unpacked_bytes(size)

    def take(self, size: int) -> None:
        """Count what unpacks to this size [bytes]."""
        if size > PIECE_BYTES:
            raise UntrustedFileError(f"a part of it has {size:,} bytes; allowed: {PIECE_BYTES:,}")
        self._left -= size
        if self._left < 0:
            raise UntrustedFileError(
                f"it unpacks to more than {self._allowed:,} bytes, too many for its size"
            )


def unpack_chunk(chunk: Chunk) -> bytes:
    """Return the content of a chunk, decompressed; if it has a CRC, that is right."""
    size = chunk.uncompressed_size
    if size > PIECE_BYTES:
        raise DatasetError(f"it says to hold {size:,} bytes; allowed: {PIECE_BYTES:,}")
    data: bytes = unpack(chunk.compression, chunk.data, size)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise DatasetError("its CRC is wrong")
    if len(data) != size:
        raise DatasetError(f"it has {len(data)} bytes instead of {size}")
    return data


def unpack(compression: str, data: Any, most: int) -> Any:
    """Return the content of data that is compressed, without more memory than it may have."""
    if compression == "zstd":
        # A frame that names its own size is given that much memory: not before it is looked at.
        if zstandard.frame_content_size(data) > most:
            raise DatasetError(f"it says to hold more than {most:,} bytes")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=most)
    if compression == "lz4":
        found = LZ4FrameDecompressor().decompress(data, max_length=most + 1)
        if len(found) > most:
            raise DatasetError(f"it holds more than {most:,} bytes")
        return found
    if compression:
        raise DatasetError(
            f"it is compressed with {compression[:20]!r}; allowed: zstd, lz4 or nothing"
        )
    return data


def read_data(stream: IO[bytes]) -> Iterator[McapRecord]:
    """Yield the records of a file up to the end of its data, chunks unpacked; compare all CRCs.

    Raises:
        UntrustedFileError and others of `DAMAGE`: it is damaged, or too large.
    """
    unpacking = Unpacking(stream.seek(0, 2))
    stream.seek(0)
    for record in StreamReader(stream, False, True, True, PIECE_BYTES).records:
        if isinstance(record, Chunk):
            unpacking.take(record.uncompressed_size)
            record.data, record.compression = unpack_chunk(record), ""
        elif isinstance(record, Attachment):
            _check_attachment(record, stream)
        yield record
        if isinstance(record, DataEnd):
            return
    raise EndOfFile


def _check_attachment(record: Attachment, stream: IO[bytes]) -> None:
    """Compare the CRC of an attachment, which ends where the stream is now."""
    builder = RecordBuilder()
    record.write(builder)
    stream.seek(-CRC_SIZE, 1)
    stated = stream.read(CRC_SIZE)
    if any(stated) and builder.end()[-CRC_SIZE:] != stated:
        raise McapError(f"the CRC of the attachment {record.name[:40]!r} is wrong")


def check_file(stream: IO[bytes]) -> None:
    """Read a whole file and compare every CRC in it; raises as `read_data` and `read_summary`."""
    for _ in read_data(stream):
        pass
    read_summary(stream)
