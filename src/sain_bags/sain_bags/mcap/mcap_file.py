"""One MCAP file: its summary, and the stretches of it that messages are read from.

Messages are found through the indexes that follow each chunk. No CRC covers those, so nothing of
them is believed that the chunk, which has one, does not confirm; what they leave out shows in the
end, as fewer messages than the statistics have.

Format: https://mcap.dev/spec.
"""

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, MetadataIndex, Schema, Statistics
from mcap.stream_reader import StreamReader
from numpy import ndarray

from sain_bags.mcap.integrity import (
    CHUNK_HEAD,
    MESSAGE_HEAD,
    RECORD_HEAD,
    check_summary,
    chunk_data,
    message_places,
    opened,
)
from sain_core.errors import DatasetError

MAGIC_SIZE: Final = 8
CHANNELS: Final = 1 << 16  # their numbers have 16 bits
STRETCH: Final = 1 << 18  # [bytes], of messages outside of chunks that are read together

INDEX_PLACE: Final = struct.Struct("<HQ")  # channel, and where in the file
INDEX_HEAD: Final = struct.Struct("<BQHI")  # opcode, length; channel, length of the entries
INDEX_ENTRY: Final = np.dtype([("log_time", "<i8"), ("place", "<u8")])
MESSAGE: Final = np.dtype(  # a message record up to its data
    {
        "names": ("opcode", "length", "channel", "sequence", "log_time", "publish_time"),
        "formats": ("u1", "<u8", "<u2", "<u4", "<i8", "<i8"),
    }
)


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

    @property
    def indexes(self) -> dict[int, int]:
        """Where in the file the index of each channel is; empty: there is none."""
        return dict(INDEX_PLACE.iter_unpack(self.index_places))


@dataclass(frozen=True)
class Messages:
    """Messages of one stretch."""

    data: ndarray  # (bytes,) uint8
    heads: ndarray  # (M,) `MESSAGE`
    starts: ndarray  # (M,) where in data their content begins


class McapFile:
    """A whole MCAP file; it is opened anew for each thing that is read."""

    def __init__(self, path: Path) -> None:
        """Read the summary.

        Raises:
            DatasetError: not a whole MCAP file, or its summary is damaged.
        """
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.metadata: list[str] = []  # names of its metadata
        self._chunks: list[Stretch] = []
        statistics: Statistics | None = None
        with opened(path) as stream:
            footer = check_summary(stream)
            self.is_verified = bool(footer.summary_crc)
            stream.seek(footer.summary_start)
            reader = StreamReader(stream, skip_magic=True)
            for record in reader.records if footer.summary_start else ():
                if isinstance(record, Statistics):
                    statistics = record
                elif isinstance(record, Schema):
                    self.schemas[record.id] = record
                elif isinstance(record, Channel):
                    self.channels[record.id] = record
                elif isinstance(record, ChunkIndex):
                    self._chunks.append(_stretch(record))
                elif isinstance(record, MetadataIndex):
                    self.metadata.append(record.name)
            if statistics is None:
                raise McapError("it has no summary")
        self.statistics: Statistics = statistics
        self._chunks.sort(key=lambda chunk: chunk.offset)

    def stretches(self, channels: Collection[int]) -> tuple[Stretch, ...]:
        """Return those that may hold messages of these channels, in the order of the file."""
        if not self._chunks and self.statistics.message_count:
            with opened(self.path) as stream:
                return tuple(_scan(stream))
        return tuple(
            chunk
            for chunk in self._chunks
            if not chunk.index_places or chunk.indexes.keys() & channels
        )

    def compare(self, found: Mapping[int, int]) -> None:
        """Compare how many messages were found, by channel, with the statistics.

        Raises:
            DatasetError: some were not found.
        """
        expected = self.statistics.channel_message_counts
        with opened(self.path):
            for number, count in found.items():
                if expected and count != (wanted := expected.get(number, 0)):
                    topic = self.channels[number].topic
                    raise McapError(f"{count} messages of {topic} were found, instead of {wanted}")

    def read(self, stretch: Stretch, channels: Collection[int]) -> Messages:
        """Read the messages of some channels, in the order of the file.

        Raises:
            DatasetError: it is damaged; the message says how it shows.
        """
        with opened(self.path) as stream:
            stream.seek(stretch.offset)
            content = stream.read(stretch.size + stretch.index_size)
            return _messages(content, stretch, channels)


def _stretch(chunk: ChunkIndex) -> Stretch:
    places = chunk.message_index_offsets.items()
    return Stretch(
        chunk.message_start_time,
        chunk.message_end_time,
        chunk.chunk_start_offset,
        chunk.chunk_length,
        True,
        b"".join(INDEX_PLACE.pack(*place) for place in places),
        chunk.message_index_length,
    )


def _messages(content: bytes, stretch: Stretch, channels: Collection[int]) -> Messages:
    data: Any = memoryview(content)[: stretch.size]
    if stretch.is_chunk:
        opcode, length = RECORD_HEAD.unpack_from(content)
        if opcode != Opcode.CHUNK or length != stretch.size - RECORD_HEAD.size:
            raise McapError("a chunk is not where it should be")
        try:
            data, _ = chunk_data(data[RECORD_HEAD.size :])
        except DatasetError as error:
            raise McapError(f"the chunk at byte {stretch.offset}: {error}") from error
    array = np.frombuffer(data, dtype=np.uint8)
    if stretch.index_places:
        return _indexed(array, content, stretch, channels)
    places = np.array(message_places(memoryview(data)), dtype=np.int64)
    return _at(array, places, channels)


def _indexed(
    data: ndarray, content: bytes, stretch: Stretch, channels: Collection[int]
) -> Messages:
    """Pick the messages that the indexes name, when each is what its index says it is."""
    entries, owners = [np.empty(0, INDEX_ENTRY)], [np.empty(0, np.uint16)]
    indexes = stretch.indexes
    for channel in indexes.keys() & channels:
        start = indexes[channel] - stretch.offset
        opcode, length, owner, size = INDEX_HEAD.unpack_from(content, start)
        if (opcode, length, owner) != (Opcode.MESSAGE_INDEX, size + 6, channel) or size % 16:
            raise McapError("the index of a chunk is damaged")
        entries.append(np.frombuffer(content, INDEX_ENTRY, size // 16, start + INDEX_HEAD.size))
        owners.append(np.full(size // 16, channel, dtype=np.uint16))
    named = np.concatenate(entries)
    order = np.argsort(named["place"], kind="stable")
    named, owner = named[order], np.concatenate(owners)[order]
    places = named["place"].astype(np.int64)
    found = _at(data, places, channels)
    right = np.array_equal(found.heads["log_time"], named["log_time"])
    right &= np.array_equal(found.heads["channel"], owner)
    if not right or (np.diff(places) <= 0).any():
        raise McapError("the index of a chunk does not fit it")
    return found


def _at(data: ndarray, places: ndarray, channels: Collection[int]) -> Messages:
    """Return the messages of some channels among the records that begin at these places."""
    if not len(places):
        return Messages(data, np.empty(0, MESSAGE), places)
    if places.min() < 0 or places.max() + MESSAGE.itemsize > len(data):
        raise McapError("a message is not inside its chunk")
    windows = np.lib.stride_tricks.sliding_window_view(data, MESSAGE.itemsize)
    heads = windows.view(MESSAGE)[:, 0][places]
    lengths = heads["length"].astype(np.int64)
    wrong = (heads["opcode"] != Opcode.MESSAGE) | (lengths < MESSAGE_HEAD.size)
    if wrong.any() or (places + RECORD_HEAD.size + lengths > len(data)).any():
        raise McapError("a message is not inside its chunk")
    chosen = np.zeros(CHANNELS, dtype=bool)
    chosen[list(channels)] = True
    wanted = chosen[heads["channel"]]
    return Messages(data, heads[wanted], places[wanted] + MESSAGE.itemsize)


def _scan(stream: IO[bytes]) -> Iterator[Stretch]:
    """Find chunks, and messages without one, in a file whose summary does not name them."""
    stream.seek(0)
    crc = zlib.crc32(stream.read(MAGIC_SIZE))
    times: list[int] = []
    start = place = MAGIC_SIZE
    while True:
        head = stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head)
        is_message = opcode == Opcode.MESSAGE
        if times and (not is_message or place - start > STRETCH):
            yield Stretch(min(times), max(times), start, place - start, False)
            times = []
        content = stream.read(length)
        if len(content) != length:
            raise McapError("it ends inside a record")
        if opcode == Opcode.DATA_END:
            expected = int.from_bytes(content, "little")
            if expected and expected != crc:
                raise McapError("its data does not match its CRC")
            return
        crc = zlib.crc32(content, zlib.crc32(head, crc))
        if is_message:
            start = start if times else place
            times.append(MESSAGE_HEAD.unpack_from(content)[2])
        elif opcode == Opcode.CHUNK:
            first, last, _, _ = CHUNK_HEAD.unpack_from(content)
            yield Stretch(first, last, place, RECORD_HEAD.size + length, True)
        place += RECORD_HEAD.size + length
