"""Writes one MCAP file: thousands of messages a second, at little processor time.

Format: https://mcap.dev/spec. Three things are done otherwise than `mcap`'s own writer does them:

* The description of a channel is in two chunks, so that a lost chunk does not lose the channel.
* The messages of a chunk are in the order of their log times.
* The rest of a failed write is cut off, so that the file can still be ended and is whole. The
  statistics count the messages in the file.
"""

import struct
import zlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import MCAP0_MAGIC

from sain_bags.mcap.log_order import in_log_order
from sain_bags.mcap.preallocated_file import PreallocatedFile

LIBRARY: Final = "sain_bags"
MESSAGE: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log, publish time
MESSAGE_SIZE: Final = 2 + 4 + 8 + 8  # [bytes], a message's content without its data
FOOTER_START: Final = struct.Struct("<BQQQ")  # the part of the footer that the summary's CRC covers
FOOTER_SIZE: Final = 8 + 8 + 4

COMPRESSORS: Final[dict[str, Callable[[], Callable[[Any], bytes]]]] = {
    "none": lambda: bytes,
    "lz4": lambda: lz4.frame.compress,
    "zstd": lambda: zstandard.ZstdCompressor().compress,
}


class McapWriter:
    """One file in the making. Every method raises `OSError` where the disk fails."""

    def __init__(self, file: PreallocatedFile, compression: str, chunk_size: int) -> None:
        """Begin a new, empty file; chunks end at a size [bytes]. `finish` leaves the file open."""
        self.statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)  # of what was written
        self.whole = False  # `finish` came to its end
        self._file = file
        self._compression = "" if compression == "none" else compression
        self._compress = COMPRESSORS[compression]()
        self._chunk_size = self._room = chunk_size
        self._end = 0  # of what was written [bytes]
        self._crc = 0
        self._described = b""  # what this chunk describes
        self._chunk = bytearray()  # messages
        self._latest, self._in_order = 0, True  # log times in this chunk
        self._fresh = b""  # what this chunk is the first to describe
        self._index: dict[int, list[int]] = {}  # by channel: log time, offset, log time, ...
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunk_indexes = bytearray()  # records: as objects they take ten times the memory
        self._metadata_indexes: list[MetadataIndex] = []
        self._write(BEGINNING)

    @property
    def size(self) -> int:
        """What was written, and what waits in the open chunk [bytes]."""
        return self._end + len(self._described) + len(self._chunk)

    def add_schema(self, name: str, definition: str) -> int:
        """Describe a message type, by its name alone if that is all; return its number."""
        number = self.statistics.schema_count = len(self._schemas) + 1
        encoding = SchemaEncoding.ROS2 if definition else SchemaEncoding.SelfDescribing
        schema = Schema(number, definition.encode(), encoding, name)
        self._schemas.append(schema)
        self._describe(schema)
        return number

    def add_channel(self, topic: str, schema: int, about: Mapping[str, str]) -> int:
        """Describe a topic; return its number."""
        number = self.statistics.channel_count = len(self._channels) + 1
        channel = Channel(number, topic, MessageEncoding.CDR, dict(about), schema)
        self._channels.append(channel)
        self._describe(channel)
        return number

    def add_message(
        self, channel: int, sequence: int, received: int, published: int, data: bytes
    ) -> None:
        """Append one message, its times in [ns since the epoch]."""
        chunk = self._chunk
        places = self._index.get(channel)
        if places is None:
            places = self._index[channel] = []
        places += (received, len(chunk))
        if received < self._latest:
            self._in_order = False
        self._latest = received
        size = MESSAGE_SIZE + len(data)
        chunk += MESSAGE.pack(Opcode.MESSAGE, size, channel, sequence, received, published)
        chunk += data
        if len(chunk) > self._room:
            self.end_chunk()

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append metadata, behind the chunk that is open."""
        self.end_chunk()
        record = _record(Metadata(name, dict(values)))
        self._write(record)
        place = self._end - len(record)
        self.statistics.metadata_count += 1
        self._metadata_indexes.append(MetadataIndex(offset=place, length=len(record), name=name))

    def end_chunk(self) -> None:
        """Write what waits in the open chunk."""
        if not self._index:
            return
        content, places = bytes(self._chunk), self._index
        if not self._in_order:
            content, places = in_log_order(content, places)
        data, start = self._described + content, len(self._described)
        # Whatever becomes of this chunk, it is not tried again.
        self._described, self._fresh = self._fresh, b""
        self._room = self._chunk_size - len(self._described)
        self._chunk, self._index, self._latest, self._in_order = bytearray(), {}, 0, True
        times = [time for index in places.values() for time in index[::2]]
        first, last = min(times), max(times)
        packed = self._compress(data)
        crc = zlib.crc32(data)
        chunk = _record(Chunk(self._compression, packed, last, first, crc, len(data)))
        indexes, offsets = _message_indexes(places, start, self._end + len(chunk))
        start = self._end
        self._write(chunk + indexes)
        self._chunk_indexes += _record(
            ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=start,
                compression=self._compression,
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=len(indexes),
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(data),
            )
        )
        self._count(first, last, places)

    def finish(self) -> None:
        """End the data, and write the summary of what is in the file; then it is `whole`.

        Also where this raises: the last chunk may be lost, and what is before it not.
        """
        try:
            self.end_chunk()
        finally:
            self._write(_record(DataEnd(self._crc)))
            self._write(self._summary())
            self.whole = True

    def _describe(self, record: Schema | Channel) -> None:
        content = _record(record)
        self._described += content
        self._fresh += content
        self._room -= len(content)

    def _count(self, first: int, last: int, places: Mapping[int, list[int]]) -> None:
        found = self.statistics
        start = found.message_start_time if found.chunk_count else first
        found.message_start_time = min(start, first)
        found.message_end_time = max(found.message_end_time, last)
        found.chunk_count += 1
        counts = found.channel_message_counts
        for channel, index in places.items():
            found.message_count += len(index) // 2
            counts[channel] = counts.get(channel, 0) + len(index) // 2

    def _summary(self) -> bytes:
        groups = (
            (Opcode.SCHEMA, _records(self._schemas)),
            (Opcode.CHANNEL, _records(self._channels)),
            (Opcode.STATISTICS, _record(self.statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indexes)),
            (Opcode.METADATA_INDEX, _records(self._metadata_indexes)),
        )
        summary, offsets = b"", b""
        for opcode, content in groups:
            start = self._end + len(summary)
            if content:
                offsets += _record(SummaryOffset(opcode, start, len(content)))
            summary += content
        start, offset_start, summary = self._end, self._end + len(summary), summary + offsets
        begun = FOOTER_START.pack(Opcode.FOOTER, FOOTER_SIZE, start, offset_start)
        footer = Footer(start, offset_start, zlib.crc32(begun, zlib.crc32(summary)))
        return summary + _record(footer) + MCAP0_MAGIC

    def _write(self, data: bytes) -> None:
        try:
            self._file.write(data)
        except OSError:
            self._file.truncate(self._end)
            raise
        self._end += len(data)
        self._crc = zlib.crc32(data, self._crc)


def _record(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


BEGINNING: Final = MCAP0_MAGIC + _record(Header(Profile.ROS2, LIBRARY))  # of each file


def _records(records: Iterable[McapRecord]) -> bytes:
    return b"".join(map(_record, records))


def _message_indexes(
    places: Mapping[int, list[int]], first: int, start: int
) -> tuple[bytes, dict[int, int]]:
    """Return the index of each channel's messages in a chunk, and where in the file each is.

    Messages begin at the byte `first` of the chunk, indexes at the byte `start` of the file.
    """
    content, offsets = bytearray(), {}
    for channel, index in places.items():
        offsets[channel] = start + len(content)
        size = 8 * len(index)
        index[1::2] = [place + first for place in index[1::2]]
        head = struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 2 + 4 + size, channel, size)
        content += head + struct.pack(f"<{len(index)}Q", *index)
    return bytes(content), offsets
