"""One MCAP file: the stretches of it that messages are read from.

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
from mcap.writer import MCAP0_MAGIC
from numpy import ndarray

from sain_bags.mcap.integrity import (
    CHUNK_HEAD,
    MESSAGE_HEAD,
    RECORD_HEAD,
    TAIL_SIZE,
    Unpacking,
    check_summary,
    chunk_data,
    opened,
    records_in,
)
from sain_bags.mcap.summary import Stretch, read_summary
from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import PIECE_BYTES

CHANNELS: Final = 1 << 16  # their numbers have 16 bits
CRC_PLACE: Final = 8 + 8 + 8  # [bytes], in a chunk: two times and its size stand before it
CRC_SIZE: Final = 4  # [bytes], also at the end of the data and of an attachment
STRETCH: Final = 1 << 18  # [bytes], of messages outside of chunks that are read together

INDEX_HEAD: Final = struct.Struct("<BQHI")  # opcode, length; channel, length of the entries
INDEX_ENTRY: Final = np.dtype([("log_time", "<i8"), ("place", "<u8")])
MESSAGE: Final = np.dtype(  # a message record up to its data
    {
        "names": ("opcode", "length", "channel", "sequence", "log_time", "publish_time"),
        "formats": ("u1", "<u8", "<u2", "<u4", "<i8", "<i8"),
    }
)


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
        with opened(path) as stream:
            start = check_summary(stream).summary_start
            summary = read_summary(stream, start)
            self.has_crcs = _has_crcs(stream, summary.chunks, start)
        self.channels, self.schemas = summary.channels, summary.schemas
        self.statistics = summary.statistics
        self._chunks = summary.chunks

    def stretches(self, channels: Collection[int]) -> tuple[Stretch, ...]:
        """Return those that may hold messages of these channels, in the order of the file."""
        if not self._chunks and self.statistics.message_count:
            with opened(self.path) as stream:
                return tuple(_scan(stream))
        return tuple(chunk for chunk in self._chunks if chunk.holds(channels))

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

    def limit_messages(self, found: int) -> None:
        """Raise `DatasetError` where more messages were found than the statistics have."""
        if found > self.statistics.message_count:
            with opened(self.path):
                raise McapError(f"it has more than {self.statistics.message_count} messages")

    def read(self, stretch: Stretch, channels: Collection[int]) -> Messages:
        """Read the messages of some channels, in the order of the file.

        Raises:
            DatasetError: it is damaged; the message says how it shows.
        """
        with opened(self.path) as stream:
            stream.seek(stretch.offset)
            content = stream.read(stretch.size + stretch.index_size)
            return _messages(content, stretch, channels)


def _has_crcs(stream: IO[bytes], chunks: list[Stretch], summary_start: int) -> bool:
    """Return whether messages have CRCs: the chunks, by the first one, else all data together."""
    end = summary_start or stream.seek(0, 2) - TAIL_SIZE
    stream.seek(chunks[0].offset + RECORD_HEAD.size + CRC_PLACE if chunks else end - CRC_SIZE)
    return any(stream.read(CRC_SIZE))


def _messages(content: bytes, stretch: Stretch, channels: Collection[int]) -> Messages:
    data: Any = memoryview(content)[: stretch.size]
    if stretch.is_chunk:
        opcode, length = RECORD_HEAD.unpack_from(content)
        if opcode != Opcode.CHUNK or length != stretch.size - RECORD_HEAD.size:
            raise McapError("a chunk is not where it should be")
        try:
            if CHUNK_HEAD.unpack_from(data, RECORD_HEAD.size)[2] != stretch.unpacked_size:
                raise DatasetError("its size is not as in its index")
            data = chunk_data(data[RECORD_HEAD.size :])
        except DatasetError as error:
            raise McapError(f"the chunk at byte {stretch.offset}: {error}") from error
    array = np.frombuffer(data, dtype=np.uint8)
    if stretch.index_places:
        return _indexed(array, content, stretch, channels)
    places = [
        start - RECORD_HEAD.size
        for opcode, start, _ in records_in(memoryview(data))
        if opcode == Opcode.MESSAGE
    ]
    found = _at(array, np.array(places, dtype=np.int64))
    wanted = np.isin(found.heads["channel"], list(channels))
    return Messages(array, found.heads[wanted], found.starts[wanted])


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
    found = _at(data, places)
    right = np.array_equal(found.heads["log_time"], named["log_time"])
    right &= np.array_equal(found.heads["channel"], owner)
    if not right or (np.diff(places) <= 0).any():
        raise McapError("the index of a chunk does not fit it")
    return found


def _at(data: ndarray, places: ndarray) -> Messages:
    """Return the messages that begin at these places."""
    if not len(places):
        return Messages(data, np.empty(0, MESSAGE), places)
    if places.min() < 0 or places.max() + MESSAGE.itemsize > len(data):
        raise McapError("a message is not inside its chunk")
    starts = len(data) - MESSAGE.itemsize + 1
    heads = np.ndarray((starts,), MESSAGE, data, strides=(1,))[places]  # one at each byte: a view
    lengths = heads["length"].astype(np.int64)
    wrong = (heads["opcode"] != Opcode.MESSAGE) | (lengths < MESSAGE_HEAD.size)
    if (late := heads["log_time"] < 0).any():
        time = int(heads["log_time"][late][0].astype(np.uint64))
        raise UntrustedFileError(
            f"a message was received at {time} ns; allowed: up to 2^63 - 1 ns, the year 2262: the"
            " recorder's clock was wrong; record it again"
        )
    if wrong.any() or (places + RECORD_HEAD.size + lengths > len(data)).any():
        raise McapError("a message is not inside its chunk")
    return Messages(data, heads, places + MESSAGE.itemsize)


def _scan(stream: IO[bytes]) -> Iterator[Stretch]:
    """Find chunks, and messages without one, in a file whose summary does not name them."""
    unpacking = Unpacking(stream.seek(0, 2))
    times: list[int] = []
    start = 0
    for opcode, place, content in data_records(stream):
        is_message = opcode == Opcode.MESSAGE
        if times and (not is_message or place - start > STRETCH):
            yield Stretch(min(times), max(times), start, place - start, False)
            times = []
        end = place + RECORD_HEAD.size + len(content)
        if is_message:
            start = start if times else place
            times.append(MESSAGE_HEAD.unpack_from(content)[2])
        elif opcode == Opcode.CHUNK:
            first, last, size, _ = CHUNK_HEAD.unpack_from(content)
            unpacking.take(size)
            yield Stretch(first, last, place, end - place, True, unpacked_size=size)
    if times:
        yield Stretch(min(times), max(times), start, end - start, False)


def data_records(stream: IO[bytes]) -> Iterator[tuple[int, int, bytes]]:
    """Yield each record's opcode, where it begins and its content, up to the end of the data.

    The CRC of the data is compared.

    Raises:
        McapError, struct.error: it is damaged.
        UntrustedFileError: a record is larger than is allowed.
    """
    size = stream.seek(0, 2)
    stream.seek(0)
    magic = stream.read(len(MCAP0_MAGIC))
    if magic != MCAP0_MAGIC:
        raise McapError("it does not begin as MCAP")
    place, crc = len(magic), zlib.crc32(magic)
    while True:
        stream.seek(place)
        head = stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head)
        if length > size - place:
            raise McapError("it ends inside a record")
        if length > PIECE_BYTES:
            raise UntrustedFileError(f"a record has {length:,} bytes; allowed: {PIECE_BYTES:,}")
        content = stream.read(length)
        if opcode == Opcode.DATA_END:
            expected = int.from_bytes(content, "little")
            if expected and expected != crc:
                raise McapError("its data does not match its CRC")
            return
        crc = zlib.crc32(content, zlib.crc32(head, crc))
        yield opcode, place, content
        place += len(head) + length


def check_file(stream: IO[bytes]) -> None:
    """Read a whole file and compare every CRC in it; raises as `data_records`."""
    unpacking = Unpacking(stream.seek(0, 2))
    for opcode, place, content in data_records(stream):
        if opcode == Opcode.CHUNK:
            unpacking.take(CHUNK_HEAD.unpack_from(content)[2])
            try:
                chunk_data(memoryview(content))
            except DatasetError as error:
                raise McapError(f"the chunk at byte {place}: {error}") from error
        elif opcode == Opcode.ATTACHMENT:
            expected = int.from_bytes(content[-CRC_SIZE:], "little")
            if expected and expected != zlib.crc32(memoryview(content)[:-CRC_SIZE]):
                raise McapError(f"the CRC of the attachment at byte {place} is wrong")
    check_summary(stream)
