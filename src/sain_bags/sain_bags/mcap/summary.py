"""The summary of an MCAP file: what it describes, counts, and where its chunks are.

Format: https://mcap.dev/spec.
"""

import struct
from collections.abc import Collection
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO, Any, Final

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from sain_bags.mcap.integrity import Unpacking, records_in
from sain_core.guarding.untrusted import NAME_LENGTH, SUMMARY_BYTES, TOPICS, limit, most_messages

INDEX_PLACE: Final = struct.Struct("<HQ")  # channel, and where in the file
CHUNK_INDEX: Final = struct.Struct("<QQQQI")  # times, place, size; of the places of indexes [bytes]
CHUNK_SIZES: Final = struct.Struct("<QI")  # of the indexes, of the compression's name [bytes]
UNPACKED: Final = struct.Struct("<QQ")  # sizes of the chunk, compressed and not [bytes]
KINDS: Final[dict[int, Any]] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.STATISTICS: Statistics,
}


@dataclass(frozen=True, slots=True)
class Stretch:
    """A chunk, or messages without a chunk; small, as a bag has thousands of them."""

    first: int  # log times of its messages [ns since the epoch]
    last: int
    offset: int  # in the file [bytes]
    size: int
    is_chunk: bool
    index_places: bytes = b""  # of the indexes, `INDEX_PLACE`
    index_size: int = 0  # [bytes], of the indexes, which follow it
    unpacked_size: int = 0  # [bytes], of a chunk

    def holds(self, channels: Collection[int]) -> bool:
        """Tell whether it may hold messages of one of these channels."""
        return not self.index_places or any(
            channel in channels for channel, _ in INDEX_PLACE.iter_unpack(self.index_places)
        )

    @property
    def indexes(self) -> dict[int, int]:
        """Where in the file the index of each channel is; empty: there is none."""
        return dict(INDEX_PLACE.iter_unpack(self.index_places))


@dataclass
class Summary:
    """What the summary of a file states."""

    statistics: Statistics = field(default_factory=lambda: Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0))
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    chunks: list[Stretch] = field(default_factory=list)  # in the order of the file


def read_summary(stream: IO[bytes], start: int) -> Summary:
    """Read the summary that begins in a file at a byte; 0: there is none.

    Raises:
        McapError: there is none, or it is damaged.
        UntrustedFileError: it states more than is allowed.
    """
    size, summary, found = stream.seek(0, 2), Summary(), False
    limit("bytes in its summary", size - start if start else 0, SUMMARY_BYTES)
    stream.seek(start)
    content = memoryview(stream.read() if start else b"")[: -len(MCAP0_MAGIC)]
    for opcode, begin, end in records_in(content):
        if opcode == Opcode.CHUNK_INDEX:
            summary.chunks.append(_stretch(content[begin:end]))
        elif opcode in KINDS:
            record = KINDS[opcode].read(ReadDataStream(BytesIO(content[begin:end])))
            found |= isinstance(record, Statistics)
            _take(summary, record)
    if not found:
        raise McapError("it has no summary")
    limit("messages", summary.statistics.message_count, most_messages(size))
    limit("topics", len(summary.channels), TOPICS)
    summary.chunks.sort(key=lambda chunk: chunk.offset)
    _check_chunks(summary.chunks, size)
    return summary


def _take(summary: Summary, record: Any) -> None:
    if isinstance(record, Statistics):
        summary.statistics = record
    elif isinstance(record, Schema):
        limit("characters in the name of a type", len(record.name), NAME_LENGTH)
        summary.schemas[record.id] = record
    else:
        limit("characters in the name of a topic", len(record.topic), NAME_LENGTH)
        summary.channels[record.id] = record


def _check_chunks(chunks: list[Stretch], size: int) -> None:
    """Check that no chunk is listed twice, and that all together are not too much."""
    unpacking, end = Unpacking(size), 0
    for chunk in chunks:
        if chunk.offset < end:
            raise McapError("its chunks are in each other")
        end = chunk.offset + chunk.size
        if end + chunk.index_size > size:
            raise McapError("a chunk is not where it should be")
        unpacking.take(chunk.unpacked_size)


def _stretch(record: memoryview) -> Stretch:
    """Read a chunk index; there are thousands of them."""
    first, last, offset, size, places = CHUNK_INDEX.unpack_from(record)
    start = CHUNK_INDEX.size
    index_size, name = CHUNK_SIZES.unpack_from(record, start + places)
    if places % INDEX_PLACE.size:
        raise McapError("the index of a chunk is damaged")
    _, unpacked = UNPACKED.unpack_from(record, start + places + CHUNK_SIZES.size + name)
    index_places = bytes(record[start : start + places])
    return Stretch(first, last, offset, size, True, index_places, index_size, unpacked)
