"""Checks an MCAP file against its specification, byte by byte: https://mcap.dev/spec."""

import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
KINDS: dict[int, Any] = {
    Opcode.HEADER: Header, Opcode.FOOTER: Footer, Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel,
    Opcode.MESSAGE: Message, Opcode.CHUNK: Chunk, Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.CHUNK_INDEX: ChunkIndex, Opcode.STATISTICS: Statistics, Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex, Opcode.SUMMARY_OFFSET: SummaryOffset,
    Opcode.DATA_END: DataEnd,
}  # fmt: skip


@dataclass(frozen=True)
class Placed:
    """A record, and where it is."""

    start: int
    end: int
    opcode: int
    record: Any


def split(content: bytes, start: int = 0) -> list[Placed]:
    """Split bytes into records; what does not fit is an error."""
    found, place = [], start
    while place < len(content):
        opcode, length = HEAD.unpack_from(content, place)
        begun, end = place + HEAD.size, place + HEAD.size + length
        assert end <= len(content), f"the record at {place} is cut"
        if opcode == Opcode.MESSAGE:
            record = Message.read(ReadDataStream(BytesIO(content[begun:end])), length)
        else:
            record = KINDS[opcode].read(ReadDataStream(BytesIO(content[begun:end])))
        found.append(Placed(place, end, opcode, record))
        place = end
    return found


def inner(chunk: Chunk) -> bytes:
    """Decompress a chunk and compare what it says of its content."""
    unpack = {"": bytes, "lz4": lz4.frame.decompress, "zstd": zstandard.decompress}
    content: bytes = unpack[chunk.compression](chunk.data)
    assert len(content) == chunk.uncompressed_size
    assert zlib.crc32(content) == chunk.uncompressed_crc
    return content


def examine(path: Path) -> Statistics:
    """Check everything that the specification says of a file; return what it says of itself."""
    content = path.read_bytes()
    assert content.startswith(MAGIC)
    assert content.endswith(MAGIC)
    records = split(content[: -len(MAGIC)], len(MAGIC))
    opcodes = [placed.opcode for placed in records]
    assert opcodes[0] == Opcode.HEADER
    assert opcodes[-1] == Opcode.FOOTER
    assert opcodes.count(Opcode.DATA_END) == opcodes.count(Opcode.FOOTER) == 1
    place = opcodes.index(Opcode.DATA_END)
    data, end, summary = records[1:place], records[place], records[place + 1 : -1]
    assert end.record.data_section_crc == zlib.crc32(content[: end.start])
    _examine_footer(content, records[-1], summary, end.end)
    return _examine_data(data, summary)


def _examine_footer(content: bytes, last: Placed, summary: list[Placed], start: int) -> None:
    footer: Footer = last.record
    assert footer.summary_start == start
    covered = content[footer.summary_start : last.start + HEAD.size + 8 + 8]
    assert zlib.crc32(covered) == footer.summary_crc
    groups = [placed for placed in summary if placed.opcode != Opcode.SUMMARY_OFFSET]
    offsets = [placed for placed in summary if placed.opcode == Opcode.SUMMARY_OFFSET]
    assert summary == groups + offsets
    assert footer.summary_offset_start == (offsets[0].start if offsets else last.start)
    changes = [first.opcode != second.opcode for first, second in pairwise(groups)]
    assert sum(changes) + 1 == len({placed.opcode for placed in groups}) == len(offsets)
    for placed in offsets:
        group = [one for one in groups if one.opcode == placed.record.group_opcode]
        assert group[0].start == placed.record.group_start
        assert group[-1].end - group[0].start == placed.record.group_length


def _examine_data(data: list[Placed], summary: list[Placed]) -> Statistics:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    times: list[int] = []
    counts: dict[int, int] = {}
    chunk_indexes = {p.record.chunk_start_offset: p.record for p in _of(summary, ChunkIndex)}
    for number, placed in enumerate(data):
        assert placed.opcode in (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA)
        if placed.opcode != Opcode.CHUNK:
            continue
        messages = _examine_chunk(placed, schemas, channels)
        behind = data[number + 1 : _next(data, number)]
        _examine_indexes(placed, behind, messages, chunk_indexes.pop(placed.start))
        for _, message in messages:
            times.append(message.log_time)
            counts[message.channel_id] = counts.get(message.channel_id, 0) + 1
    assert not chunk_indexes
    told = {p.record.id: p.record for p in _of(summary, Schema)}
    assert schemas.items() <= told.items()
    told_channels = {p.record.id: p.record for p in _of(summary, Channel)}
    assert channels.items() <= told_channels.items()
    metadata = [(p.start, p.end - p.start, p.record.name) for p in _of(data, Metadata)]
    indexed = [p.record for p in _of(summary, MetadataIndex)]
    assert metadata == [(index.offset, index.length, index.name) for index in indexed]
    (found,) = _of(summary, Statistics)
    assert found.record == Statistics(
        attachment_count=0,
        channel_count=len(told_channels),
        channel_message_counts=counts,
        chunk_count=len(_of(data, Chunk)),
        message_count=len(times),
        message_end_time=max(times, default=0),
        message_start_time=min(times, default=0),
        metadata_count=len(metadata),
        schema_count=len(told),
    )
    return found.record


def _next(data: list[Placed], number: int) -> int:
    """Return where the indexes behind a chunk end."""
    for place in range(number + 1, len(data)):
        if data[place].opcode != Opcode.MESSAGE_INDEX:
            return place
    return len(data)


def _examine_chunk(
    placed: Placed, schemas: dict[int, Schema], channels: dict[int, Channel]
) -> list[tuple[int, Message]]:
    """Check the order in a chunk; return its messages and where in it they are."""
    messages = []
    for one in split(inner(placed.record)):
        record = one.record
        if one.opcode == Opcode.SCHEMA:
            assert schemas.setdefault(record.id, record) == record
        elif one.opcode == Opcode.CHANNEL:
            assert record.schema_id in schemas
            assert channels.setdefault(record.id, record) == record
        else:
            assert one.opcode == Opcode.MESSAGE
            assert record.channel_id in channels
            messages.append((one.start, record))
    assert messages
    times = [message.log_time for _, message in messages]
    assert times == sorted(times)
    assert (placed.record.message_start_time, placed.record.message_end_time) == (
        min(times),
        max(times),
    )
    return messages


def _examine_indexes(
    chunk: Placed, indexes: list[Placed], messages: list[tuple[int, Message]], told: ChunkIndex
) -> None:
    assert told.chunk_length == chunk.end - chunk.start
    assert told.message_index_length == sum(index.end - index.start for index in indexes)
    starts = {index.record.channel_id: index.start for index in indexes}
    assert dict(told.message_index_offsets) == starts
    for name in ("compression", "message_start_time", "message_end_time", "uncompressed_size"):
        assert getattr(told, name) == getattr(chunk.record, name)
    assert told.compressed_size == len(chunk.record.data)
    found: dict[int, list[tuple[int, int]]] = {}
    for place, message in messages:
        found.setdefault(message.channel_id, []).append((message.log_time, place))
    assert {index.record.channel_id: index.record.records for index in indexes} == found


def _of(records: list[Placed], kind: type) -> list[Placed]:
    return [placed for placed in records if isinstance(placed.record, kind)]
