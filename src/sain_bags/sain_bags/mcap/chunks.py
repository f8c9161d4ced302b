"""One chunk of an MCAP file, opened so that no damage to it can pass for data.

Format: https://mcap.dev/spec, section "Chunk".
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.opcode import Opcode

from sain_core.errors import DatasetError

RECORD_HEAD: Final = struct.Struct("<BQ")  # opcode, length of the content
CHUNK_HEAD: Final = struct.Struct("<QQQI")  # first and last time, size and CRC once decompressed
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
COMPRESSIONS: Final = (b"", b"lz4", b"zstd")
LIMIT: Final = 1 << 30  # [bytes], what is larger is taken for a damaged length


@dataclass(frozen=True)
class OpenedChunk:
    """What was in a chunk."""

    records: tuple[tuple[int, memoryview], ...]  # opcode and content
    checked: bool  # it has a CRC, and that is right


def chunk_content_fits(head: bytes, length: int) -> bool:
    """Tell from its first bytes whether the lengths in a chunk agree with the record's [bytes]."""
    start = CHUNK_HEAD.size
    size = int.from_bytes(head[start : start + 4], "little")
    end = start + 4 + size
    if head[start + 4 : end] not in COMPRESSIONS or len(head) < end + 8:
        return False
    return length == end + 8 + int.from_bytes(head[end : end + 8], "little")


def open_chunk(content: bytes) -> OpenedChunk:
    """Decompress a chunk record's content, compare its CRC and split it into records.

    Raises:
        DatasetError: it is damaged; the message says how it shows.
    """
    data, checked = chunk_data(memoryview(content))
    records = tuple((opcode, data[start:end]) for opcode, start, end in _records(data))
    return OpenedChunk(records, checked)


def chunk_data(content: memoryview) -> tuple[memoryview, bool]:
    """Decompress a chunk record's content; return it, and whether it has a CRC, which is right.

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
    return memoryview(data), bool(crc)


def message_places(data: memoryview) -> list[int]:
    """Return where the message records of a chunk begin."""
    head = RECORD_HEAD.size
    return [start - head for opcode, start, _ in _records(data) if opcode == Opcode.MESSAGE]


def _decompress(compression: bytes, data: memoryview, size: int) -> Any:
    allowed = min(size, LIMIT)
    try:
        if compression == b"zstd":
            # A frame that names its own size is given that much memory: not before it is looked at.
            if zstandard.frame_content_size(data) > LIMIT:
                raise DatasetError(f"it says to hold more than {LIMIT} bytes")
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=allowed)
        if compression == b"lz4":
            return LZ4FrameDecompressor().decompress(data, max_length=allowed + 1)
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError, MemoryError) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(f"it cannot be decompressed ({error})") from error
    return data


def _records(data: memoryview) -> Iterator[tuple[int, int, int]]:
    """Yield each record's opcode, and where its content begins and ends."""
    place, size = 0, len(data)
    while place < size:
        start = place + RECORD_HEAD.size
        if start > size:
            raise DatasetError("it ends inside a record")
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place = start + length
        if place > size or (opcode == Opcode.MESSAGE and length < MESSAGE_HEAD.size):
            raise DatasetError("its records do not fit into it")
        yield opcode, start, place
