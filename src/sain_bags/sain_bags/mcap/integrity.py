"""Damage to an MCAP file: chunks opened so that it cannot pass for data, and the summary's CRC.

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
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Footer
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import (
    PIECE_BYTES,
    PIECE_RECORDS,
    limit,
    open_regular,
    unpacked_bytes,
)

RECORD_HEAD: Final = struct.Struct("<BQ")  # opcode, length of the content
CHUNK_HEAD: Final = struct.Struct("<QQQI")  # first and last time, size and CRC once decompressed
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time

FOOTER_SIZE: Final = 1 + 8 + 8 + 8  # [bytes], opcode, length and the footer but its CRC
TAIL_SIZE: Final = FOOTER_SIZE + 4 + 8  # with the CRC and the closing magic
WINDOW: Final = 1 << 20  # [bytes], compared at a time

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


def check_summary(stream: IO[bytes]) -> Footer:
    """Compare the summary's CRC, which mcap's readers leave unchecked; return the footer.

    Raises:
        McapError: the file has no end, or the summary is damaged.
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
    if not isinstance(footer, Footer):
        raise McapError("it has no footer")
    if footer.summary_start > size:
        raise McapError("its summary is not where it should be")
    if footer.summary_start and footer.summary_crc:
        rest, crc = max(size - TAIL_SIZE + FOOTER_SIZE - footer.summary_start, 0), 0
        stream.seek(footer.summary_start)
        while rest and (content := stream.read(min(rest, WINDOW))):
            rest, crc = rest - len(content), zlib.crc32(content, crc)
        if rest or crc != footer.summary_crc:
            raise McapError("its summary does not match its CRC")
    return footer


class Unpacking:
    """Counts what a file unpacks to: a small one that holds much is not unpacked."""

    def __init__(self, size: int) -> None:
        """Begin for a file of this size [bytes]."""
        self._allowed = self._left = unpacked_bytes(size)

    def take(self, size: int) -> None:
        """Count what unpacks to this size [bytes].

        Raises:
            UntrustedFileError: that is more than is allowed.
        """
        if size > PIECE_BYTES:
            raise UntrustedFileError(f"a part of it has {size:,} bytes; allowed: {PIECE_BYTES:,}")
        self._left -= size
        if self._left < 0:
            raise UntrustedFileError(
                f"it unpacks to more than {self._allowed:,} bytes, too many for its size"
            )


def chunk_data(content: memoryview) -> memoryview:
    """Decompress a chunk record's content; if it has a CRC, that is right.

    Raises:
        DatasetError: it is damaged; the message says how it shows.
    """
    _, _, size, crc = CHUNK_HEAD.unpack_from(content)
    name_end = CHUNK_HEAD.size + 4 + int.from_bytes(content[28:32], "little")
    data = _decompress(bytes(content[32:name_end]), content[name_end + 8 :], size)
    if crc and zlib.crc32(data) != crc:
        raise DatasetError("its CRC is wrong")
    if not crc and len(data) != size:
        raise DatasetError(f"it has {len(data)} bytes instead of {size}")
    return memoryview(data)


def _decompress(compression: bytes, data: memoryview, size: int) -> Any:
    if size > PIECE_BYTES:
        raise DatasetError(f"it says to hold {size:,} bytes; allowed: {PIECE_BYTES:,}")
    try:
        return unpack(compression, data, size)
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError, MemoryError) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(f"it cannot be decompressed ({error})") from error


def unpack(compression: bytes, data: Any, most: int) -> Any:
    """Return the content of data that is compressed, without more memory than it may have.

    Raises:
        DatasetError: it has more than `most` bytes.
        ZstdError, RuntimeError, ValueError, EOFError: it is damaged.
    """
    if compression == b"zstd":
        # A frame that names its own size is given that much memory: not before it is looked at.
        if zstandard.frame_content_size(data) > most:
            raise DatasetError(f"it says to hold more than {most:,} bytes")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=most)
    if compression == b"lz4":
        found = LZ4FrameDecompressor().decompress(data, max_length=most + 1)
        if len(found) > most:
            raise DatasetError(f"it holds more than {most:,} bytes")
        return found
    if compression:
        name = compression[:20].decode(errors="replace")
        raise DatasetError(f"it is compressed with {name!r}; allowed: zstd, lz4 or nothing")
    return data


def records_in(data: memoryview) -> Iterator[tuple[int, int, int]]:
    """Yield each record's opcode, and where its content begins and ends."""
    place, size, count = 0, len(data), 0
    while place < size:
        limit("records in a part", count := count + 1, PIECE_RECORDS)
        start = place + RECORD_HEAD.size
        if start > size:
            raise DatasetError("it ends inside a record")
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place = start + length
        if place > size or (opcode == Opcode.MESSAGE and length < MESSAGE_HEAD.size):
            raise DatasetError("its records do not fit into it")
        yield opcode, start, place
