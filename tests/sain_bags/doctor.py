"""Checks an MCAP file of our writer against the specification: https://mcap.dev/spec."""

from collections import Counter
from itertools import takewhile
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.records import (
    Channel,
    Chunk,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk

from sain_bags.mcap.integrity import read_summary

Placed = tuple[int, int, McapRecord]  # where a record begins and ends


def examine(path: Path) -> Statistics:
    """Check the records of a file, its indexes, CRCs and summary; return its statistics."""
    records: list[Placed] = []
    with path.open("rb") as stream:
        start = 8  # behind the magic
        for record in StreamReader(stream, emit_chunks=True, validate_crcs=True).records:
            records.append((start, stream.tell(), record))
            start = stream.tell()
        summary = read_summary(stream)
        stream.seek(0)
        metadata = [one.name for one in make_reader(stream).iter_metadata()]
    assert isinstance(records[0][2], Header)
    assert metadata == [one.name for *_, one in records if isinstance(one, Metadata)]
    described: dict[tuple[type, int], Any] = {}
    counts: Counter[int] = Counter()
    times: list[int] = []
    indexes = {index.chunk_start_offset: index for index in summary.chunk_indexes}
    for number, (start, end, chunk) in enumerate(records):
        if isinstance(chunk, Chunk):
            index = indexes.pop(start)
            assert index.chunk_length == end - start
            behind = takewhile(lambda one: isinstance(one[2], MessageIndex), records[number + 1 :])
            found = list(behind)
            assert {one.channel_id: place for place, _, one in found} == index.message_index_offsets
            assert index.message_index_length == sum(last - first for first, last, _ in found)
            messages = _examine_chunk(chunk, described, [one for *_, one in found])
            counts.update(message.channel_id for message in messages)
            times += [message.log_time for message in messages]
    assert not indexes
    for (kind, number), one in described.items():
        assert one == (summary.schemas if kind is Schema else summary.channels)[number]
    statistics = summary.statistics
    assert statistics is not None
    assert statistics.message_count == len(times)
    assert statistics.channel_message_counts == counts
    assert (statistics.message_start_time, statistics.message_end_time) == (
        min(times, default=0),
        max(times, default=0),
    )
    assert statistics.chunk_count == len(summary.chunk_indexes)
    assert statistics.channel_count == len(summary.channels)
    return statistics


def _examine_chunk(
    chunk: Chunk, described: dict[tuple[type, int], Any], indexes: list[Any]
) -> list[Message]:
    """Check that a chunk describes its messages, which stand by time and are indexed."""
    messages = []
    for record in breakup_chunk(chunk, validate_crc=True):
        if isinstance(record, Schema | Channel):
            assert described.setdefault((type(record), record.id), record) == record
        elif isinstance(record, Message):
            assert (Channel, record.channel_id) in described
            messages.append(record)
    times = [message.log_time for message in messages]
    assert times == sorted(times)
    assert (chunk.message_start_time, chunk.message_end_time) == (times[0], times[-1])
    indexed = sorted(entry for index in indexes for entry in index.records)
    assert [time for time, _ in indexed] == times
    return messages
