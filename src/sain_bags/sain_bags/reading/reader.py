"""Reads bags without ROS: every message is decoded with the definitions that the bag carries."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from sain_bags.bag.layouts import Decoder
from sain_bags.bag.metadata import (
    METADATA_FILE,
    Span,
    find_files,
    listed_counts,
    listed_spans,
    reindex,
    span_of,
    whole_span,
)
from sain_bags.mcap.integrity import check_file, opened
from sain_bags.reading.bag_files import BagFiles
from sain_bags.reading.foreign import ReadableFiles
from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import DECODED_BYTES, TimeAllowance, limit

BAG_HELP: Final = "a bag's folder, or its MCAP file"  # what `Bag` opens


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


class Bag(BagFiles):
    """A whole bag: a rosbag2 folder with one or more files, or one MCAP file alone.

    Everything that is read is checked against the CRCs in MCAP files. Of any other storage a copy
    is made for as long as the bag is read.
    """

    def __init__(self, path: Path) -> None:
        """Open a bag."""
        self.path = path
        self.metadata, self.files = find_files(path)
        self._readable = ReadableFiles(self.metadata, self.files)
        super().__init__(self._readable.files)
        self.decoding = TimeAllowance(self.size)  # for all messages
        spans = [span_of(one) for one in self.statistics]
        self._span = whole_span(spans)
        self._check_metadata(spans)
        self._decoders: dict[int, Decoder] = {}  # by number of a channel

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
        for found in self.channels:
            key = found.topic, found.type
            numbers = self.statistics[found.file].channel_message_counts
            counts[key] += numbers.get(found.channel.id, 0)
            about[key] = {**about.get(key, {}), **found.channel.metadata}
        hashes = self._type_hashes()
        return tuple(
            TopicSummary(
                *key,
                counts[key],
                about[key].get("offered_qos_profiles", ""),
                about[key].get("topic_type_hash") or hashes.get(key, ""),
            )
            for key in sorted(counts)
        )

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return self._span.messages

    @property
    def start(self) -> int:
        """When the first message was received [ns since the epoch]."""
        return self._span.start

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s]."""
        return 1e-9 * (self._span.end - self._span.start)

    @property
    def custom_data(self) -> dict[str, str]:
        """What the recording says about itself."""
        return dict(self.metadata.get("custom_data", {}))

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
        for number, raw in self._numbered(topics, None, types):
            message = self.decode(number, raw.data)
            yield Received(raw.topic, raw.type, message, raw.log_time, raw.publish_time)

    def raw_messages(
        self, topics: Collection[str] | None = None, start: int | None = None
    ) -> Iterator[Raw]:
        """Yield messages as they are, in the order in which they were received, over all files.

        Args:
            topics: only these; None: all.
            start: only those received then or later [ns since the epoch]; None: all.
        """
        for _, raw in self._numbered(topics, start):
            yield raw

    @property
    def has_crcs(self) -> bool:
        """Whether damage to any message would be detected; in sqlite3 files it is not."""
        return all(file.has_crcs for file in self._files)

    def check(self) -> None:
        """Read all files and compare every CRC that they have.

        Raises:
            DatasetError: a bit is not as it was written.
        """
        for file in self._files:
            with opened(file.path) as stream:
                check_file(stream)

    def decode(self, number: int, data: bytes) -> Any:
        """Return a message of a channel, by its number in the bag, decoded."""
        channel = self.channels[number]
        try:
            if number not in self._decoders:
                self._decoders[number] = Decoder(channel.types(), channel.type)
            limit("bytes in a message", len(data), DECODED_BYTES)
        except (DatasetError, UntrustedFileError) as error:
            raise DatasetError(f"{self.path}: {channel.topic} is not decoded: {error}") from error
        try:
            with self.decoding:
                return self._decoders[number].decode(data)
        except UntrustedFileError as error:
            raise DatasetError(f"{self.path}: {channel.topic} is not decoded: {error}") from error
        except (DatasetError, UnicodeDecodeError) as error:
            raise DatasetError(
                f"{self.path}: a message of {channel.topic} is not as its definition says ({error})"
            ) from error

    @property
    def _are_counted(self) -> bool:
        """Whether the files state how many messages each channel has."""
        return all(
            sum(one.channel_message_counts.values()) == one.message_count for one in self.statistics
        )

    def _check_metadata(self, spans: Sequence[Span]) -> None:
        """Refuse a bag whose files hold something else than ``metadata.yaml`` says."""
        listed = listed_counts(self.metadata)
        types = dict(listed.keys())  # by topic; what is of another one is not counted
        found: Counter[tuple[str, str]] = Counter()
        for topic in self.topics:
            if topic.messages and (topic.name not in types or not topic.type):
                found[topic.name, types.get(topic.name, topic.type)] += topic.messages
            elif (topic.name, topic.type) in listed:
                found[topic.name, topic.type] += topic.messages
        differing = [key for key in sorted({*listed, *found}) if listed[key] != found[key]]
        if listed and differing and self._are_counted:
            counts = ", ".join(
                f"{found[key]:,} messages of {key[0]}, not {listed[key]:,}" for key in differing
            )
            raise DatasetError(
                f"{self.path} is not whole: it has {counts} as {METADATA_FILE} says; get the bag"
                f" again, or {reindex(self.path)}"
            )
        for file, span in zip(self.files, spans, strict=True):
            if not listed_spans(self.metadata).get(file.name, span).overlaps(span):
                raise DatasetError(
                    f"{file} is of another recording than {METADATA_FILE} says: its messages are of"
                    f" another time; get the bag again, or {reindex(self.path)}"
                )

    def _type_hashes(self) -> dict[tuple[str, str], str]:
        """Return the hashes of types in ``metadata.yaml``, by topic and type."""
        listed = self.metadata.get("topics_with_message_count", ())
        topics = [entry["topic_metadata"] for entry in listed]
        return {(topic["name"], topic["type"]): topic["type_description_hash"] for topic in topics}

    def _numbered(
        self,
        topics: Collection[str] | None,
        start: int | None,
        types: Collection[str] | None = None,
    ) -> Iterator[tuple[int, Raw]]:
        """Yield messages, each with the number of its channel in the bag."""
        names = [(channel.topic, channel.type) for channel in self.channels]
        for batch in self.batches(topics, start, types):
            data = batch.data.tobytes()
            columns = (
                batch.channels, batch.starts, batch.starts + batch.sizes, batch.log_times,
                batch.publish_times, batch.sequences,
            )  # fmt: skip
            rows = zip(*(column.tolist() for column in columns), strict=True)
            for number, first, end, log_time, publish_time, sequence in rows:
                topic, kind = names[number]
                yield number, Raw(topic, kind, data[first:end], log_time, publish_time, sequence)
