"""Reads bags without ROS: every message is decoded with the definitions that the bag carries."""

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import yaml
import zstandard
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Footer, McapRecord, Statistics
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory

from sain_bags.metadata import METADATA_FILE
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
    MemoryError,
    RuntimeError,  # lz4
    zstandard.ZstdError,
)


@dataclass(frozen=True)
class TopicSummary:
    """One topic of a bag."""

    name: str
    type: str
    messages: int


@dataclass(frozen=True)
class Received:
    """One decoded message and when it came."""

    topic: str
    type: str
    message: Any  # attributes named as the definition's fields
    log_time: int  # [ns since the epoch], received
    publish_time: int  # [ns since the epoch]


class Bag:
    """A whole bag: a rosbag2 folder with one MCAP file, or such a file alone.

    Everything that is read is checked against the CRCs in the file.
    """

    def __init__(self, path: Path) -> None:
        """Open a bag.

        Raises:
            DatasetError: not a bag, not whole, or damaged; the message says what to do.
        """
        self.path = path
        self.metadata: Mapping[str, Any] = {}
        self.file = self._find_file()
        with self._opened() as stream:
            self._summary, self._statistics = _read_summary(stream)

    @property
    def topics(self) -> tuple[TopicSummary, ...]:
        """All topics, by name."""
        counts = self._statistics.channel_message_counts
        found = [
            TopicSummary(
                channel.topic, self._summary.schemas[channel.schema_id].name, counts.get(number, 0)
            )
            for number, channel in self._summary.channels.items()
        ]
        return tuple(sorted(found, key=lambda topic: topic.name))

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return int(self._statistics.message_count)

    @property
    def start(self) -> int:
        """When the first message was received [ns since the epoch]."""
        return int(self._statistics.message_start_time)

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s]."""
        return 1e-9 * (self._statistics.message_end_time - self.start)

    @property
    def custom_data(self) -> dict[str, str]:
        """What the recording says about itself."""
        return dict(self.metadata.get("custom_data") or {})

    def messages(
        self, topics: Collection[str] | None = None, types: Collection[str] | None = None
    ) -> Iterator[Received]:
        """Yield messages in the order in which they were received.

        Args:
            topics: only these; None: all.
            types: only of these types; None: all.

        Raises:
            DatasetError: damage was found on the way.
        """
        wanted = [
            topic.name
            for topic in self.topics
            if (topics is None or topic.name in topics) and (types is None or topic.type in types)
        ]
        with self._opened() as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for schema, channel, message, decoded in reader.iter_decoded_messages(wanted):
                name = schema.name if schema else ""
                yield Received(channel.topic, name, decoded, message.log_time, message.publish_time)

    def check(self) -> None:
        """Read the whole file and compare every CRC.

        Raises:
            DatasetError: a bit is not as it was written.
        """
        for _ in self.records():
            pass

    def records(self) -> Iterator[McapRecord]:
        """Yield every record as `mcap` has it, comparing every CRC on the way.

        Raises:
            DatasetError: a bit is not as it was written.
        """
        with self._opened() as stream:
            yield from StreamReader(stream, validate_crcs=True).records
            check_summary(stream)

    def _find_file(self) -> Path:
        if self.path.is_file():
            return self.path
        if not self.path.is_dir():
            raise DatasetError(f"no bag at {self.path}")
        files = sorted(self.path.glob("*.mcap"))
        if not (self.path / METADATA_FILE).is_file():
            if not files:
                raise DatasetError(f"{self.path} is no bag: it has no {METADATA_FILE}")
            raise DatasetError(f"{self.path} was not closed: it has no {METADATA_FILE}; {_RESCUE}")
        self.metadata = self._read_metadata()
        named = self.metadata.get("relative_file_paths", [])
        if len(named) != 1 or not (self.path / named[0]).is_file():
            raise DatasetError(
                f"{self.path / METADATA_FILE} names the files {named}; one MCAP file beside it"
                " is what can be read here"
            )
        return self.path / str(named[0])

    def _read_metadata(self) -> Mapping[str, Any]:
        path = self.path / METADATA_FILE
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
            return dict(content["rosbag2_bagfile_information"])
        except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
            raise DatasetError(
                f"{path} cannot be read ({error}); `ros2 bag reindex` makes a new one"
            ) from error

    @contextmanager
    def _opened(self) -> Iterator[IO[bytes]]:
        try:
            with self.file.open("rb") as stream:
                yield stream
        except OSError as error:
            raise DatasetError(f"{self.file} cannot be read: {error.strerror or error}") from error
        except DAMAGE as error:
            reason = str(error) or type(error).__name__
            raise DatasetError(
                f"{self.file} is damaged or not whole ({reason}); {_RESCUE}"
            ) from error


_RESCUE: Final = "`ros2 run sain_bags recover BAG --out NEW` saves what is undamaged"


def _read_summary(stream: IO[bytes]) -> tuple[Summary, Statistics]:
    check_summary(stream)
    stream.seek(0)
    summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        raise McapError("it has no summary")
    return summary, summary.statistics


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
