"""What damage to an MCAP file looks like, and which part of it `mcap` does not look at."""

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

import zstandard
from mcap.exceptions import McapError
from mcap.records import Footer
from mcap.stream_reader import StreamReader

from sain_core.errors import DatasetError

FOOTER_SIZE: Final = 1 + 8 + 8 + 8  # [bytes], opcode, length and the footer but its CRC
TAIL_SIZE: Final = FOOTER_SIZE + 4 + 8  # with the CRC and the closing magic
WINDOW: Final = 1 << 20  # [bytes], compared at a time

DAMAGE: Final = (
    McapError,
    ValueError,  # mcap's CRC errors and bad text
    struct.error,
    EOFError,
    KeyError,
    IndexError,
    MemoryError,
    RuntimeError,  # lz4
    zstandard.ZstdError,
)
RESCUE: Final = "`ros2 run sain_bags recover BAG --out NEW` saves what is undamaged"


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a file; what goes wrong with it inside becomes a `DatasetError` that names it."""
    try:
        with path.open("rb") as stream:
            yield stream
    except OSError as error:
        raise DatasetError(f"{path} cannot be read: {error.strerror or error}") from error
    except DAMAGE as error:
        reason = str(error) or type(error).__name__
        raise DatasetError(f"{path} is damaged or not whole ({reason}); {RESCUE}") from error


def check_summary(stream: IO[bytes]) -> Footer:
    """Compare the summary's CRC, which mcap's readers leave unchecked; return the footer.

    Raises:
        McapError: the file has no end, or the summary is damaged.
    """
    size = stream.seek(0, 2)
    if size < TAIL_SIZE:
        raise McapError("it ends too early")
    stream.seek(size - TAIL_SIZE)
    footer = next(iter(StreamReader(stream, skip_magic=True).records))
    if not isinstance(footer, Footer):
        raise McapError("it has no footer")
    if footer.summary_start > size:
        raise McapError("its summary is not where it should be")
    if footer.summary_start and footer.summary_crc:
        rest, crc = max(size - TAIL_SIZE + FOOTER_SIZE - footer.summary_start, 0), 0
        stream.seek(footer.summary_start)
        while rest and (content := stream.read(min(rest, WINDOW))):
            rest, crc = rest - len(content), zlib.crc32(content, crc)
        if rest or crc != footer.summary_crc:
            raise McapError("its summary does not match its CRC")
    return footer
