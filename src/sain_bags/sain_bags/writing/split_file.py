"""One file of a bag that is being written."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from sain_bags.bag.metadata import (
    METADATA_RECORD,
    FileSummary,
    Span,
    Topic,
    bag_metadata,
    metadata_record,
)
from sain_bags.mcap.mcap_writer import McapWriter
from sain_bags.mcap.preallocated_file import PreallocatedFile


class SplitFile:
    """A file that is written by topic. Every method raises `OSError` where the disk fails."""

    def __init__(
        self, path: Path, compression: str, chunk_size: int, about: Mapping[str, str], ros: str
    ) -> None:
        """Create the file with the metadata of the bag."""
        self.name = path.name
        self._ros = ros
        self._file = PreallocatedFile(path)
        self._mcap = McapWriter(self._file, compression, chunk_size)
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[str, int] = {}
        self.write = self._mcap.add_message  # (channel, sequence, received, published, data)
        self.end_chunk = self._mcap.end_chunk
        # Metadata at the end is all that a whole bag needs; this is for what a crash leaves.
        self._describe_bag((), about)

    @property
    def full(self) -> bool:
        """Whether the disk is full, so that the file must be ended."""
        return self._file.full

    @property
    def size(self) -> int:
        """Written and waiting [bytes]."""
        return self._mcap.size

    @property
    def whole(self) -> bool:
        """Whether the file was ended, and all that is in it can be read."""
        return self._mcap.whole

    @property
    def counts(self) -> dict[str, int]:
        """Messages in the file, by topic."""
        counts = self._mcap.statistics.channel_message_counts
        return {topic: counts.get(number, 0) for topic, number in self._channels.items()}

    @property
    def summary(self) -> FileSummary:
        """The file's entry in ``metadata.yaml``."""
        found = self._mcap.statistics
        span = Span(found.message_start_time, found.message_end_time, found.message_count)
        return FileSummary(self.name, span)

    def channel(self, topic: Topic) -> int:
        """Describe a topic, if that was not done; return its number."""
        number = self._channels.get(topic.name)
        if number is None:
            key = (topic.type, topic.definition)
            if key not in self._schemas:
                self._schemas[key] = self._mcap.add_schema(*key)
            about = {
                "offered_qos_profiles": topic.qos_text(),
                "topic_type_hash": topic.type_hash,
            }
            number = self._mcap.add_channel(topic.name, self._schemas[key], about)
            self._channels[topic.name] = number
        return number

    def finish(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        """End the file and make sure that it is on the disk.

        Also where this raises, the file may be `whole`.
        """
        try:
            try:
                self._mcap.end_chunk()
                self._describe_bag(topics, custom_data)
            finally:
                self._mcap.finish()
        finally:
            self._file.close()

    def _describe_bag(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        counts = self.counts
        counted = [(topic, counts[topic.name]) for topic in topics if topic.name in counts]
        about = bag_metadata([self.summary], counted, custom_data, self._ros)
        self._mcap.add_metadata(METADATA_RECORD, metadata_record(about))
