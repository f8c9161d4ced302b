"""An MCAP file from its beginning to the end of its data, with every CRC compared.

Format: https://mcap.dev/spec.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Final

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from sain_bags.mcap.integrity import (
    CHUNK_HEAD,
    RECORD_HEAD,
    Unpacking,
    check_summary,
    chunk_data,
)
from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import PIECE_BYTES

ATTACHMENT_CRC: Final = 4  # [bytes], at the end of an attachment; 0: it has none


@dataclass(frozen=True)
class DataRecord:
    """A record of the data."""

    opcode: int
    start: int  # in the file [bytes]
    content: bytes

    @property
    def end(self) -> int:
        """Where in the file the next one begins [bytes]."""
        return self.start + RECORD_HEAD.size + len(self.content)


def data_records(stream: IO[bytes]) -> Iterator[DataRecord]:
    """Yield the records of a file up to the end of its data, and compare the CRC of all that.

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
        record = DataRecord(opcode, place, stream.read(length))
        if opcode == Opcode.DATA_END:
            expected = int.from_bytes(record.content, "little")
            if expected and expected != crc:
                raise McapError("its data does not match its CRC")
            return
        crc = zlib.crc32(record.content, zlib.crc32(head, crc))
        yield record
        place = record.end


def check_file(stream: IO[bytes]) -> None:
    """Read a whole file and compare every CRC in it; raises as `data_records`."""
    unpacking = Unpacking(stream.seek(0, 2))
    for record in data_records(stream):
        if record.opcode == Opcode.CHUNK:
            unpacking.take(CHUNK_HEAD.unpack_from(record.content)[2])
            try:
                chunk_data(memoryview(record.content))
            except DatasetError as error:
                raise McapError(f"the chunk at byte {record.start}: {error}") from error
        elif record.opcode == Opcode.ATTACHMENT:
            content = memoryview(record.content)
            expected = int.from_bytes(content[-ATTACHMENT_CRC:], "little")
            if expected and expected != zlib.crc32(content[:-ATTACHMENT_CRC]):
                raise McapError(f"the CRC of the attachment at byte {record.start} is wrong")
    check_summary(stream)
