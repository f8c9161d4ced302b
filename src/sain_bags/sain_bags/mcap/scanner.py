"""Reads the records of an MCAP file that may be cut or damaged, one at a time.

Where the bytes make no sense, reading goes on behind the record if its length leads to another one,
and otherwise at the next chunk whose CRC is right. Only one record is in memory at a time.
"""

import re
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import IO, Any, Final

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, McapRecord, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from sain_bags.mcap.integrity import (
    CHUNK_HEAD,
    DAMAGE,
    MESSAGE_HEAD,
    RECORD_HEAD,
    OpenedChunk,
    Unpacking,
    chunk_content_fits,
    open_chunk,
)
from sain_core.errors import DatasetError
from sain_core.guarding.untrusted import PIECE_BYTES, limit, most_messages, unpacked_bytes

WINDOW: Final = 1 << 20  # [bytes], searched at a time
HEAD: Final = 48  # [bytes], of a content, by which lengths are judged: a chunk's fit in
DESCRIPTION_LIMIT: Final = 16 << 20  # [bytes], no description is longer
INDEX_ENTRY: Final = 16  # [bytes], of one message in an index
CHUNK_START: Final = re.compile(
    rb"\x06(?=.{36}(?:\x00\x00\x00\x00|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd))", re.DOTALL
)
CHUNK_START_SIZE: Final = 1 + 36 + 8

READERS: Final[dict[int, Callable[[Any], McapRecord]]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.ATTACHMENT: Attachment.read,
}
KNOWN: Final = {*READERS, Opcode.CHUNK, Opcode.MESSAGE, Opcode.MESSAGE_INDEX, Opcode.DATA_END}


@dataclass(frozen=True)
class Record:
    """A record that makes sense in itself."""

    start: int  # [bytes] from the beginning of the file
    end: int
    opcode: int
    content: bytes


@dataclass(frozen=True)
class Gap:
    """Bytes that make no sense."""

    start: int  # [bytes] from the beginning of the file
    end: int
    is_chunk: bool  # a chunk seems to begin here
    reason: str


class Scanner:
    """Goes through one file from its beginning to the end of its data."""

    def __init__(self, stream: IO[bytes]) -> None:
        """Read a file that can be sought in."""
        self._stream = stream
        self.size = stream.seek(0, 2)
        self.ended = False  # the record that ends the data was found
        self.matches: bool | None = None  # the data's CRC; None: there is none to compare
        self._crc = zlib.crc32(self._read(0, len(MCAP0_MAGIC)))
        self._whole = True  # all bytes so far went into the CRC
        self._unpacking = Unpacking(self.size)
        self._messages = 0
        self._searched = 0  # [bytes] of what could be chunks, while the next one is searched

    def __iter__(self) -> Iterator[Record | Gap]:
        """Yield records and gaps in the order of the file."""
        place = len(MCAP0_MAGIC)
        if self._read(0, place) != MCAP0_MAGIC:
            self._whole = False
            yield Gap(0, min(place, self.size), False, "the file does not begin as MCAP")
        while place < self.size:
            record = self._record(place)
            if record is None:
                self._whole = False
                gap = self._gap(place)
                yield gap
                place = gap.end
                continue
            if record.opcode == Opcode.DATA_END:
                self._end(record)
                return
            self._crc = zlib.crc32(self._read(place, RECORD_HEAD.size), self._crc)
            self._crc = zlib.crc32(record.content, self._crc)
            yield record
            place = record.end

    def open_chunk(self, record: Record) -> OpenedChunk:
        """Return what is in a chunk.

        Raises:
            DatasetError: it is damaged, or there would be more in the file than is allowed.
        """
        self._unpacking.take(CHUNK_HEAD.unpack_from(record.content)[2])
        found = open_chunk(record.content)
        self._messages += found.messages
        limit("messages", self._messages, most_messages(self.size))
        return found

    def _end(self, record: Record) -> None:
        self.ended = True
        expected = int.from_bytes(record.content, "little")
        if self._whole and expected:
            self.matches = expected == self._crc

    def _record(self, place: int) -> Record | None:
        opcode, length = self._head(place)
        if not self._fits(place, opcode, length):
            return None
        start = place + RECORD_HEAD.size
        content = self._read(start, length)
        if len(content) != length or (opcode in READERS and not is_exact(opcode, content)):
            return None
        return Record(place, start + length, opcode, content)

    def _fits(self, place: int, opcode: int, length: int) -> bool:
        """Tell whether a record can be here, from its first bytes."""
        start = place + RECORD_HEAD.size
        if not opcode or start + length > self.size or length > PIECE_BYTES:
            return False
        if opcode == Opcode.CHUNK:
            return chunk_content_fits(self._read(start, HEAD), length)
        if opcode == Opcode.MESSAGE:
            return length >= MESSAGE_HEAD.size
        if opcode == Opcode.DATA_END:
            return length == 4
        if opcode == Opcode.MESSAGE_INDEX:
            entries = int.from_bytes(self._read(start, 6)[2:], "little")
            return length == 6 + entries and entries % INDEX_ENTRY == 0
        if opcode == Opcode.ATTACHMENT:
            return True
        return opcode in READERS and length <= DESCRIPTION_LIMIT

    def _gap(self, place: int) -> Gap:
        opcode, length = self._head(place)
        after = place + RECORD_HEAD.size + length
        is_chunk = opcode == Opcode.CHUNK
        if not opcode or after > self.size:
            end = self._next_chunk(place + 1)
            cut = end == self.size
            reason = "the file is cut or damaged here" if cut else "its length is damaged"
            return Gap(place, end, is_chunk, reason)
        if after == self.size or self._fits(after, *self._head(after)):
            unknown = f"it is a record of unknown kind ({opcode})"
            reason = "its content is damaged" if opcode in KNOWN else unknown
            return Gap(place, after, is_chunk, reason)
        return Gap(place, self._next_chunk(place + 1), is_chunk, "its length is damaged")

    def _next_chunk(self, place: int) -> int:
        """Return where the next chunk with a right CRC begins, or the size of the file."""
        while place < self.size:
            window = self._read(place, WINDOW + CHUNK_START_SIZE)
            for found in CHUNK_START.finditer(window):
                if self._is_chunk(place + found.start()):
                    return place + found.start()
            place += WINDOW
        return self.size

    def _is_chunk(self, place: int) -> bool:
        record = self._record(place)
        if record is None:
            return False
        # Anything can look like a chunk, and like one that is large: not all of it is opened.
        size = CHUNK_HEAD.unpack_from(record.content)[2]
        self._searched += len(record.content) + size
        if self._searched > unpacked_bytes(self.size):
            return False
        try:
            return open_chunk(record.content).checked
        except DatasetError:
            return False

    def _head(self, place: int) -> tuple[int, int]:
        head = self._read(place, RECORD_HEAD.size)
        return RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)

    def _read(self, place: int, size: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(size)


def parse(opcode: int, content: bytes | memoryview) -> Any:
    """Return a record's content as `mcap` has it; only for the kinds in `READERS`."""
    return READERS[opcode](ReadDataStream(BytesIO(content)))


def is_exact(opcode: int, content: bytes | memoryview) -> bool:
    """Tell whether a content is just what its values, written again, come to.

    `mcap` reads over lengths that do not agree; this does not. An attachment's CRC is compared too.
    """
    try:
        builder = RecordBuilder()
        parse(opcode, content).write(builder)
    except (*DAMAGE, OverflowError):
        return False
    again = builder.end()[RECORD_HEAD.size :]
    if opcode == Opcode.ATTACHMENT and bytes(content[-4:]) == bytes(4):  # it has no CRC
        return again[:-4] == content[:-4]
    return again == content
