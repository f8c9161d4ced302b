"""One MCAP file: the messages of its chunks, found through the indexes that follow each chunk.

No CRC covers those indexes, so nothing of them is believed that the chunk, which has one, does not
confirm; what they leave out shows in the end, as fewer messages than the statistics have.

Format: https://mcap.dev/spec.
"""

import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import IO, Final

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex
from numpy import ndarray

from sain_bags.mcap.integrity import (
    CRC_SIZE,
    DAMAGE,
    TAIL_SIZE,
    Unpacking,
    opened,
    read_summary,
    unpack_chunk,
)
from sain_core.errors import DatasetError, UntrustedFileError

CHANNELS: Final = 1 << 16  # their numbers have 16 bits
RECORD_HEAD: Final = 1 + 8  # [bytes], opcode and length of the content
CRC_PLACE: Final = 8 + 8 + 8  # [bytes], in a chunk: two times and its size stand before it

INDEX_HEAD: Final = struct.Struct("<BQHI")  # opcode, length; channel, length of the entries
INDEX_ENTRY: Final = np.dtype([("log_time", "<i8"), ("place", "<u8")])
MESSAGE: Final = np.dtype(  # a message record up to its data
    {
        "names": ("opcode", "length", "channel", "sequence", "log_time", "publish_time"),
        "formats": ("u1", "<u8", "<u2", "<u4", "<i8", "<i8"),
    }
)
SPARSE: Final = 4  # times as much data as messages: it is not kept for these few
MESSAGE_HEAD: Final = MESSAGE.itemsize - RECORD_HEAD  # [bytes], what its length counts of that


@dataclass(frozen=True)
class Batch:
    """Messages; entry i of each array is of the i-th."""

    data: ndarray  # (bytes,) uint8
    starts: ndarray  # (M,) where in data the message begins, in CDR with its encapsulation header
    sizes: ndarray  # (M,) [bytes]
    channels: ndarray  # (M,) number of its channel, in the file or in the bag
    log_times: ndarray  # (M,) [ns since the epoch], received
    publish_times: ndarray  # (M,) [ns since the epoch]
    sequences: ndarray  # (M,) the publisher's count, 0: not known
    ranks: ndarray  # (M,) which chunk it is from: breaks ties of log times

    def __len__(self) -> int:
        """Return how many messages there are."""
        return len(self.starts)

    def __getitem__(self, index: ndarray) -> "Batch":
        """Return some of the messages, by a mask or by their places."""
        _, *columns = vars(self).values()
        return Batch(self.data, *(column[index] for column in columns))

    def message(self, place: int) -> bytes:
        """Return the bytes of one message."""
        start = int(self.starts[place])
        return self.data[start : start + int(self.sizes[place])].tobytes()

    def compact(self) -> "Batch":
        """Return the same messages without the data between them."""
        ends = np.cumsum(self.sizes)
        bounds = zip(self.starts.tolist(), (self.starts + self.sizes).tolist(), strict=True)
        parts = [self.data[start:end] for start, end in bounds]
        data = np.concatenate(parts) if parts else self.data[:0]
        return replace(self, data=data, starts=ends - self.sizes)


class McapFile:
    """A whole MCAP file; it is opened anew for each thing that is read."""

    def __init__(self, path: Path) -> None:
        """Read the summary."""
        self.path = path
        with opened(path) as stream:
            summary = read_summary(stream)
            chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
            _check_chunks(chunks, stream.seek(0, 2))
            self.has_crcs = _has_crcs(stream, chunks)
        assert summary.statistics is not None
        self.channels, self.schemas = summary.channels, summary.schemas
        self.statistics = summary.statistics
        self._chunks = tuple(chunks)

    @property
    def is_indexed(self) -> bool:
        """Return whether the summary leads to all messages; else they must be copied first."""
        are_all = all(chunk.message_index_offsets for chunk in self._chunks)
        return are_all and (bool(self._chunks) or not self.statistics.message_count)

    def chunks(self, channels: Collection[int]) -> tuple[ChunkIndex, ...]:
        """Return those that hold messages of these channels, in the order of the file."""
        return tuple(
            chunk
            for chunk in self._chunks
            if any(channel in channels for channel in chunk.message_index_offsets)
        )

    def log_times(self, chunk: ChunkIndex, channel: int) -> ndarray:
        """Return when the messages of a channel in a chunk were received (M,); none is unpacked."""
        with opened(self.path) as stream:
            stream.seek(chunk.chunk_start_offset + chunk.chunk_length)
            entries, _ = _entries(stream.read(chunk.message_index_length), chunk, {channel})
            return entries["log_time"].copy()

    def compare(self, found: Mapping[int, int]) -> None:
        """Compare how many messages were found, by channel, with the statistics."""
        expected = self.statistics.channel_message_counts
        with opened(self.path):
            for number, count in found.items():
                if expected and count != (wanted := expected.get(number, 0)):
                    topic = self.channels[number].topic
                    raise McapError(f"{count} messages of {topic} were found, instead of {wanted}")

    def limit_messages(self, found: int) -> None:
        """Raise `DatasetError` where more messages were found than the statistics have."""
        if found > self.statistics.message_count:
            with opened(self.path):
                raise McapError(f"it has more than {self.statistics.message_count} messages")

    def read(self, chunk: ChunkIndex, channels: Collection[int], rank: int) -> Batch:
        """Read the messages of some channels, in the order of the file."""
        with opened(self.path) as stream:
            stream.seek(chunk.chunk_start_offset)
            content = stream.read(chunk.chunk_length + chunk.message_index_length)
            try:
                data = _unpacked(content, chunk)
            except UntrustedFileError:
                raise
            except (DatasetError, *DAMAGE) as error:
                where = f"the chunk at byte {chunk.chunk_start_offset}"
                raise McapError(f"{where}: {error}") from error
            batch = _indexed(np.frombuffer(data, np.uint8), content, chunk, channels, rank)
        sparse = SPARSE * int(batch.sizes.sum()) < len(batch.data)
        return batch.compact() if sparse else batch


def _check_chunks(chunks: list[ChunkIndex], size: int) -> None:
    """Check that no chunk is listed twice, and that all together are not too much."""
    unpacking, end = Unpacking(size), 0
    for chunk in chunks:
        if chunk.chunk_start_offset < end:
            raise McapError("its chunks are in each other")
        end = chunk.chunk_start_offset + chunk.chunk_length
        if end + chunk.message_index_length > size:
            raise McapError("a chunk is not where it should be")
        unpacking.take(chunk.uncompressed_size)


def _has_crcs(stream: IO[bytes], chunks: list[ChunkIndex]) -> bool:
    """Return whether messages have CRCs: the chunks, by the first one, else all data together."""
    if chunks:
        stream.seek(chunks[0].chunk_start_offset + RECORD_HEAD + CRC_PLACE)
    else:
        stream.seek(-TAIL_SIZE + RECORD_HEAD, 2)
        stream.seek(int.from_bytes(stream.read(8), "little") - CRC_SIZE)  # before the summary
    return any(stream.read(CRC_SIZE))


def _unpacked(content: bytes, index: ChunkIndex) -> bytes:
    """Return what is in a chunk, which is as its index says."""
    if content[0] != Opcode.CHUNK:
        raise DatasetError("it is not where it should be")
    chunk = Chunk.read(ReadDataStream(BytesIO(content[RECORD_HEAD : index.chunk_length])))
    if chunk.uncompressed_size != index.uncompressed_size:
        raise DatasetError("its size is not as in its index")
    return unpack_chunk(chunk)


def _indexed(
    data: ndarray, content: bytes, chunk: ChunkIndex, channels: Collection[int], rank: int
) -> Batch:
    """Pick the messages that the indexes name, when each is what its index says it is."""
    named, owner = _entries(content[chunk.chunk_length :], chunk, channels)
    order = np.argsort(named["place"], kind="stable")
    named, owner = named[order], owner[order]
    places = named["place"].astype(np.int64)
    heads = _heads(data, places)
    right = np.array_equal(heads["log_time"], named["log_time"])
    right &= np.array_equal(heads["channel"], owner)
    if not right or (np.diff(places) <= 0).any():
        raise McapError("the index of a chunk does not fit it")
    return Batch(
        data,
        places + MESSAGE.itemsize,
        heads["length"].astype(np.int64) - MESSAGE_HEAD,
        heads["channel"].astype(np.int64),
        heads["log_time"].copy(),
        heads["publish_time"].copy(),
        heads["sequence"].copy(),
        np.full(len(heads), rank),
    )


def _entries(
    content: bytes, chunk: ChunkIndex, channels: Collection[int]
) -> tuple[ndarray, ndarray]:
    """Return the entries (M,) of channels in the indexes behind a chunk, and their channels."""
    entries, owners = [np.empty(0, INDEX_ENTRY)], [np.empty(0, np.uint16)]
    indexes = chunk.message_index_offsets
    for channel in indexes.keys() & channels:
        start = indexes[channel] - chunk.chunk_start_offset - chunk.chunk_length
        opcode, length, owner, size = INDEX_HEAD.unpack_from(content, start)
        if (opcode, length, owner) != (Opcode.MESSAGE_INDEX, size + 6, channel) or size % 16:
            raise McapError("the index of a chunk is damaged")
        entries.append(np.frombuffer(content, INDEX_ENTRY, size // 16, start + INDEX_HEAD.size))
        owners.append(np.full(size // 16, channel, dtype=np.uint16))
    return np.concatenate(entries), np.concatenate(owners)


def _heads(data: ndarray, places: ndarray) -> ndarray:
    """Return the heads (M,) of the messages that begin at these places."""
    if not len(places):
        return np.empty(0, MESSAGE)
    if places.min() < 0 or places.max() + MESSAGE.itemsize > len(data):
        raise McapError("a message is not inside its chunk")
    starts = len(data) - MESSAGE.itemsize + 1
    heads: ndarray = np.ndarray((starts,), MESSAGE, data, strides=(1,))[
        places
    ]  # one at each byte: a view
    lengths = heads["length"].astype(np.int64)
    wrong = (heads["opcode"] != Opcode.MESSAGE) | (lengths < MESSAGE_HEAD)
    if (late := heads["log_time"] < 0).any():
        time = int(heads["log_time"][late][0].astype(np.uint64))
        raise UntrustedFileError(
            f"a message was received at {time} ns; allowed: up to 2^63 - 1 ns, the year 2262: the"
            " recorder's clock was wrong; record it again"
        )
    if wrong.any() or (places + RECORD_HEAD + lengths > len(data)).any():
        raise McapError("a message is not inside its chunk")
    return heads
