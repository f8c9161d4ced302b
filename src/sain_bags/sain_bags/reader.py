"""Reads bags without ROS: every message is decoded with the definitions that the bag carries."""

import heapq
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import yaml
import zstandard
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Footer, McapRecord, Statistics
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
    offered_qos: str = ""  # the publishers' profiles as the recorder wrote them, YAML
    type_hash: str = ""  # RIHS01_..., empty where the recorder did not know it


class Raw(NamedTuple):
    """One message as it was received, not decoded."""

    topic: str
    type: str
    data: bytes  # CDR, with its encapsulation header
    log_time: int  # [ns since the epoch], received
    publish_time: int  # [ns since the epoch]
    sequence: int  # the publisher's count, 0: not known


@dataclass(frozen=True)
class Received:
    """One decoded message and when it came."""

    topic: str
    type: str
    message: Any  # attributes named as the definition's fields
    log_time: int  # [ns since the epoch], received
    publish_time: int  # [ns since the epoch]


class Bag:
    """A whole bag: a rosbag2 folder with one or more MCAP files, or one such file alone.

    Everything that is read is checked against the CRCs in the files.
    """

    def __init__(self, path: Path) -> None:
        """Open a bag.

        Raises:
            DatasetError: not a bag, not whole, or damaged; the message says what to do.
        """
        self.path = path
        self.metadata: Mapping[str, Any] = {}
        self.files = self._find_files()
        self._summaries = [self._read_summary(file) for file in self.files]

    @property
    def file(self) -> Path:
        """The first of its files; all of them are `files`."""
        return self.files[0]

    @property
    def size(self) -> int:
        """All its files' size [bytes]."""
        return sum(file.stat().st_size for file in self.files)

    @property
    def topics(self) -> tuple[TopicSummary, ...]:
        """All topics, by name."""
        counts: Counter[tuple[str, str]] = Counter()
        about: dict[tuple[str, str], Mapping[str, str]] = {}
        for summary, statistics in self._summaries:
            for number, channel in summary.channels.items():
                key = channel.topic, _type(summary, channel)
                counts[key] += statistics.channel_message_counts.get(number, 0)
                about[key] = {**about.get(key, {}), **channel.metadata}
        return tuple(
            TopicSummary(
                *key,
                counts[key],
                about[key].get("offered_qos_profiles", ""),
                about[key].get("topic_type_hash", ""),
            )
            for key in sorted(counts)
        )

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return sum(statistics.message_count for _, statistics in self._summaries)

    @property
    def start(self) -> int:
        """When the first message was received [ns since the epoch]."""
        filled = (found for _, found in self._summaries if found.message_count)
        return min((statistics.message_start_time for statistics in filled), default=0)

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s]."""
        filled = (found for _, found in self._summaries if found.message_count)
        end = max((statistics.message_end_time for statistics in filled), default=0)
        return 1e-9 * (end - self.start)

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
        decoders: dict[bytes, Any] = {}
        for schema, channel, message in self._mcap_messages(wanted, None):
            definition = schema.data if schema else b""
            if definition not in decoders:  # files of a split bag number their schemas as they like
                find = DecoderFactory().decoder_for
                decoders[definition] = find(channel.message_encoding, schema)
            decoder = decoders[definition]
            if decoder is None:
                raise DatasetError(
                    f"{self.path}: {channel.topic} is neither CDR nor described by a ros2msg text"
                )
            decoded = decoder(message.data)
            name = schema.name if schema else ""
            yield Received(channel.topic, name, decoded, message.log_time, message.publish_time)

    def raw_messages(
        self, topics: Collection[str] | None = None, start: int | None = None
    ) -> Iterator[Raw]:
        """Yield messages as they are, in the order in which they were received, over all files.

        Args:
            topics: only these; None: all.
            start: only those received then or later [ns since the epoch]; None: all.

        Raises:
            DatasetError: damage was found on the way.
        """
        for schema, channel, message in self._mcap_messages(topics, start):
            yield Raw(
                channel.topic,
                schema.name if schema else "",
                message.data,
                message.log_time,
                message.publish_time,
                message.sequence,
            )

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
        for file in self.files:
            with _opened(file) as stream:
                yield from StreamReader(stream, validate_crcs=True).records
                check_summary(stream)

    def _mcap_messages(self, topics: Collection[str] | None, start: int | None) -> Iterator[Any]:
        streams = [_messages_of(file, topics, start) for file in self.files]
        return heapq.merge(*streams, key=lambda found: found[2].log_time)

    def _read_summary(self, file: Path) -> tuple[Summary, Statistics]:
        with _opened(file) as stream:
            return _read_summary(stream)

    def _find_files(self) -> tuple[Path, ...]:
        if self.path.is_file():
            return (self.path,)
        if not self.path.is_dir():
            raise DatasetError(f"no bag at {self.path}")
        files = sorted(self.path.glob("*.mcap"))
        if not (self.path / METADATA_FILE).is_file():
            if not files:
                raise DatasetError(f"{self.path} is no bag: it has no {METADATA_FILE}")
            raise DatasetError(f"{self.path} was not closed: it has no {METADATA_FILE}; {_RESCUE}")
        self.metadata = self._read_metadata()
        named = self.metadata.get("relative_file_paths", [])
        missing = [name for name in named if not (self.path / name).is_file()]
        if not named or missing:
            raise DatasetError(
                f"{self.path / METADATA_FILE} names the files {named}"
                f"{f'; {missing[0]} is not there' if missing else ''}"
            )
        return tuple(self.path / str(name) for name in named)

    def _read_metadata(self) -> Mapping[str, Any]:
        path = self.path / METADATA_FILE
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
            return dict(content["rosbag2_bagfile_information"])
        except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
            raise DatasetError(
                f"{path} cannot be read ({error}); `ros2 bag reindex` makes a new one"
            ) from error


_RESCUE: Final = "`ros2 run sain_bags recover BAG --out NEW` saves what is undamaged"


@contextmanager
def _opened(file: Path) -> Iterator[IO[bytes]]:
    try:
        with file.open("rb") as stream:
            yield stream
    except OSError as error:
        raise DatasetError(f"{file} cannot be read: {error.strerror or error}") from error
    except DAMAGE as error:
        reason = str(error) or type(error).__name__
        raise DatasetError(f"{file} is damaged or not whole ({reason}); {_RESCUE}") from error


def _messages_of(file: Path, topics: Collection[str] | None, start: int | None) -> Iterator[Any]:
    with _opened(file) as stream:
        reader = make_reader(stream, validate_crcs=True)
        yield from reader.iter_messages(topics, starting_at=start)


def _type(summary: Summary, channel: Channel) -> str:
    schema = summary.schemas.get(channel.schema_id)
    return schema.name if schema else ""


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
