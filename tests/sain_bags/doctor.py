"""Checks a file of our writer: indexes, CRCs and summary fit what `mcap` reads in it."""

from collections import Counter
from pathlib import Path

from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Channel, Chunk, Message, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk

from sain_bags.mcap.integrity import read_summary
from sain_bags.reading.reader import Bag


def examine(path: Path) -> Statistics:
    """Read a file record by record, as a stream and by its indexes; return its statistics."""
    with path.open("rb") as stream:
        summary = read_summary(stream)
        stream.seek(0)
        records = list(StreamReader(stream, emit_chunks=True, validate_crcs=True).records)
        stream.seek(0)
        streamed = list(NonSeekingReader(stream, validate_crcs=True).iter_messages())
        stream.seek(0)
        indexed = list(make_reader(stream, validate_crcs=True).iter_messages())
    chunks = [list(breakup_chunk(one, True)) for one in records if isinstance(one, Chunk)]
    channels: set[int] = set()
    for chunk in chunks:  # messages are described before, and stand by time
        channels |= {one.id for one in chunk if isinstance(one, Channel)}
        messages = [one for one in chunk if isinstance(one, Message)]
        assert {one.channel_id for one in messages} <= channels
        assert [one.log_time for one in messages] == sorted(one.log_time for one in messages)
    assert sum(isinstance(one, Message) for chunk in chunks for one in chunk) == len(indexed)
    assert [one for *_, one in indexed] == sorted(
        (one for *_, one in streamed), key=lambda one: one.log_time
    )
    found = [(one.log_time, one.data) for *_, one in indexed]
    assert [(one.log_time, one.data) for one in Bag(path).raw_messages()] == found
    statistics = summary.statistics
    assert statistics is not None
    assert statistics.message_count == len(indexed)
    assert statistics.channel_message_counts == Counter(one.channel_id for *_, one in indexed)
    times = [one.log_time for *_, one in indexed] or [0]
    assert (statistics.message_start_time, statistics.message_end_time) == (times[0], times[-1])
    assert statistics.chunk_count == len(summary.chunk_indexes) == len(chunks)
    assert statistics.channel_count == len(summary.channels)
    return statistics
