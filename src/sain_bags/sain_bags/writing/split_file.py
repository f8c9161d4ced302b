"""One file of a bag, written by topic: thousands of messages a second, at little processor time.

Format: https://mcap.dev/spec. Four things are done otherwise than `mcap`'s own writer does them:

* The description of a channel is in two chunks, so that a lost chunk does not lose the channel.
* The messages of a chunk are in the order of their log times.
* A few channels may have chunks of their own, so that they are read without the others.
* The rest of a failed write is cut off, so that the file can still be ended and is whole. The
  statistics count the messages in the file.
"""

import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

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
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC

from sain_bags.bag.metadata import (
    METADATA_RECORD,
    START_RECORD,
    Span,
    Topic,
    bag_metadata,
    metadata_record,
    span_of,
)
from sain_bags.bag.parts import BEGINNING
from sain_bags.mcap.preallocated_file import PreallocatedFile

FOOTER_START: Final = struct.Struct("<BQQQ")  # the part of the footer that the summary's CRC covers
FOOTER_SIZE: Final = 8 + 8 + 4
MESSAGE: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log, publish time
MESSAGE_SIZE: Final = 2 + 4 + 8 + 8  # [bytes], a message's content without its data

COMPRESSORS: Final[dict[str, Callable[[], Callable[[Any], bytes]]]] = {
    "none": lambda: bytes,
    "lz4": lambda: lz4.frame.compress,
    "zstd": lambda: zstandard.ZstdCompressor().compress,
}


class Content(NamedTuple):
    """What a chunk holds."""

    data: bytes
    places: Mapping[int, list[int]]  # by channel: log time, offset in data, log time, ...
    first: int  # log time [ns since the epoch]
    last: int


class OpenChunk:
    """Collects messages, and what describes them, chunk after chunk."""

    def __init__(self, chunk_size: int) -> None:
        """Begin; a chunk is full at a size [bytes]."""
        self._chunk_size = self._room = chunk_size
        self._described = b""  # what this chunk describes
        self._fresh = b""  # what it is the first to describe: the next one does so again
        self._messages: list[tuple[int, int, bytes, bytes]] = []  # log time, channel, record

    @property
    def size(self) -> int:
        """What waits here [bytes]."""
        return self._chunk_size - self._room

    def describe(self, record: bytes) -> None:
        """Add the description of a type or a channel, for this chunk and the next."""
        self._described += record
        self._fresh += record
        self._room -= len(record)

    def add(self, channel: int, sequence: int, received: int, published: int, data: bytes) -> bool:
        """Append one message, its times in [ns since the epoch]; return whether this is full."""
        size = MESSAGE_SIZE + len(data)
        head = MESSAGE.pack(Opcode.MESSAGE, size, channel, sequence, received, published)
        self._messages.append((received, channel, head, data))
        self._room -= MESSAGE.size + len(data)
        return self._room < 0

    def take(self) -> Content | None:
        """Return what was collected, by log time, and begin the next chunk; None: no message."""
        if not self._messages:
            return None
        messages = sorted(self._messages, key=itemgetter(0))  # those of a time stay as they are
        place = len(self._described)
        places: dict[int, list[int]] = defaultdict(list)
        for received, channel, head, data in messages:
            places[channel] += (received, place)
            place += len(head) + len(data)
        records = [part for message in messages for part in message[2:]]
        content = b"".join((self._described, *records))
        self._described, self._fresh, self._messages = self._fresh, b"", []
        self._room = self._chunk_size - len(self._described)
        return Content(content, places, messages[0][0], messages[-1][0])


class SplitFile:
    """One of the files of a bag. Every method raises `OSError` where the disk fails."""

    def __init__(
        self, path: Path, compression: str, chunk_size: int, about: Mapping[str, str], ros: str
    ) -> None:
        """Create the file with the metadata of the bag; chunks end at a size [bytes]."""
        self.statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)  # of what was written
        self.whole = False  # `close` came to its end
        self.path, self._ros = path, ros
        self._disk = PreallocatedFile(path)
        self._compression = "" if compression == "none" else compression
        self._compress = COMPRESSORS[compression]()
        self._rare, self._others = OpenChunk(chunk_size), OpenChunk(chunk_size)
        self._chunk_of: dict[int, OpenChunk] = {}  # by channel
        self._end = 0  # of what was written [bytes]
        self._crc = 0
        self._schemas: dict[tuple[str, str], Schema] = {}  # by type and definition
        self._channels: dict[str, Channel] = {}  # by topic
        self._chunk_indexes = bytearray()  # records: as objects they take ten times the memory
        self._metadata_indexes: list[MetadataIndex] = []
        self._write(BEGINNING)
        # Metadata at the end is all that a whole bag needs; this is for what a crash leaves.
        self._add_metadata(START_RECORD, (), about)

    @property
    def size(self) -> int:
        """What was written, and what waits in open chunks [bytes]."""
        return self._end + self._rare.size + self._others.size

    @property
    def full(self) -> bool:
        """Whether the disk is full, so that the file must be ended."""
        return self._disk.full

    @property
    def counts(self) -> dict[str, int]:
        """Messages in the file, by topic."""
        counts = self.statistics.channel_message_counts
        return {topic: counts.get(one.id, 0) for topic, one in self._channels.items()}

    @property
    def span(self) -> Span:
        """When its messages were received."""
        return span_of(self.statistics)

    def channel(self, topic: Topic) -> int:
        """Describe a topic, if that was not done, of a type without a text by its name alone.

        Returns:
            its number. Topics of a rare type have chunks of their own.
        """
        if topic.name in self._channels:
            return self._channels[topic.name].id
        chunk = self._rare if topic.is_rare else self._others
        key = topic.type, topic.definition
        if key not in self._schemas:
            number = self.statistics.schema_count = len(self._schemas) + 1
            encoding = SchemaEncoding.ROS2 if topic.definition else SchemaEncoding.SelfDescribing
            self._schemas[key] = Schema(number, topic.definition.encode(), encoding, topic.type)
            chunk.describe(_record(self._schemas[key]))
        number = self.statistics.channel_count = len(self._channels) + 1
        schema = self._schemas[key].id
        channel = Channel(number, topic.name, MessageEncoding.CDR, topic.about, schema)
        self._channels[topic.name], self._chunk_of[number] = channel, chunk
        chunk.describe(_record(channel))
        return number

    def add_message(
        self, channel: int, sequence: int, received: int, published: int, data: bytes
    ) -> None:
        """Append one message, its times in [ns since the epoch]."""
        chunk = self._chunk_of[channel]
        if chunk.add(channel, sequence, received, published, data):
            self._end_chunk(chunk)

    def close(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        """End the file and make sure that it is on the disk.

        Also where this raises, the file may be `whole`: the last chunk may be lost, and what is
        before it not.
        """
        try:
            try:
                self.end_chunks()
                self._add_metadata(METADATA_RECORD, topics, custom_data)
            finally:
                self._write(_record(DataEnd(self._crc)))
                self._write(self._summary())
                self.whole = True
        finally:
            self._disk.close()

    def _add_metadata(
        self, name: str, topics: Iterable[Topic], custom_data: Mapping[str, str]
    ) -> None:
        counts = self.counts
        counted = [(topic, counts[topic.name]) for topic in topics if topic.name in counts]
        about = bag_metadata({self.path.name: self.span}, counted, custom_data, self._ros)
        record = _record(Metadata(name, metadata_record(about)))
        self._write(record)
        place = self._end - len(record)
        self.statistics.metadata_count += 1
        self._metadata_indexes.append(MetadataIndex(offset=place, length=len(record), name=name))

    def end_chunks(self) -> None:
        """Write what waits in open chunks."""
        try:
            self._end_chunk(self._rare)
        finally:
            self._end_chunk(self._others)

    def _end_chunk(self, chunk: OpenChunk) -> None:
        content = chunk.take()  # whatever becomes of it, it is not tried again
        if content is None:
            return
        data, _, first, last = content
        packed, size, crc = self._compress(data), len(data), zlib.crc32(data)
        record = _record(Chunk(self._compression, packed, last, first, crc, size))
        indexes, offsets = _message_indexes(content, self._end + len(record))
        start = self._end
        self._write(record + indexes)
        self._chunk_indexes += _record(
            ChunkIndex(
                chunk_length=len(record),
                chunk_start_offset=start,
                compression=self._compression,
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=len(indexes),
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=size,
            )
        )
        self._count(first, last, content.places)

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
            (Opcode.SCHEMA, _records(self._schemas.values())),
            (Opcode.CHANNEL, _records(self._channels.values())),
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
            self._disk.write(data)
        except OSError:
            self._disk.truncate(self._end)
            raise
        self._end += len(data)
        self._crc = zlib.crc32(data, self._crc)


def _record(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _records(records: Iterable[McapRecord]) -> bytes:
    return b"".join(map(_record, records))


def _message_indexes(found: Content, start: int) -> tuple[bytes, dict[int, int]]:
    """Return the index of each channel's messages in a chunk, and where in the file each is.

    The indexes begin at the byte `start` of the file.
    """
    content, offsets = bytearray(), {}
    for channel, index in found.places.items():
        offsets[channel] = start + len(content)
        size = 8 * len(index)
        head = struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 2 + 4 + size, channel, size)
        content += head + struct.pack(f"<{len(index)}Q", *index)
    return bytes(content), offsets
