"""One file of a bag, written by topic."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from sain_bags.bag.metadata import (
    METADATA_RECORD,
    START_RECORD,
    Span,
    Topic,
    bag_metadata,
    metadata_record,
    span_of,
)
from sain_bags.mcap.mcap_writer import McapWriter
from sain_bags.mcap.preallocated_file import PreallocatedFile


class SplitFile(McapWriter):
    """One of the files of a bag. Every method raises `OSError` where the disk fails."""

    def __init__(
        self, path: Path, compression: str, chunk_size: int, about: Mapping[str, str], ros: str
    ) -> None:
        """Create the file with the metadata of the bag."""
        self.path, self._ros = path, ros
        self._disk = PreallocatedFile(path)
        super().__init__(self._disk, compression, chunk_size)
        self._types: dict[tuple[str, str], int] = {}
        self._topics: dict[str, int] = {}
        # Metadata at the end is all that a whole bag needs; this is for what a crash leaves.
        self._describe_bag(START_RECORD, (), about)

    @property
    def full(self) -> bool:
        """Whether the disk is full, so that the file must be ended."""
        return self._disk.full

    @property
    def counts(self) -> dict[str, int]:
        """Messages in the file, by topic."""
        counts = self.statistics.channel_message_counts
        return {topic: counts.get(number, 0) for topic, number in self._topics.items()}

    @property
    def span(self) -> Span:
        """When its messages were received."""
        return span_of(self.statistics)

    def channel(self, topic: Topic) -> int:
        """Describe a topic, if that was not done; return its number."""
        number = self._topics.get(topic.name)
        if number is None:
            key = (topic.type, topic.definition)
            if key not in self._types:
                self._types[key] = self.add_schema(*key, rare=topic.is_rare)
            number = self.add_channel(topic.name, self._types[key], topic.about)
            self._topics[topic.name] = number
        return number

    def close(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        """End the file and make sure that it is on the disk.

        Also where this raises, the file may be `whole`.
        """
        try:
            try:
                self.end_chunks()
                self._describe_bag(METADATA_RECORD, topics, custom_data)
            finally:
                self.finish()
        finally:
            self._disk.close()

    def _describe_bag(
        self, name: str, topics: Iterable[Topic], custom_data: Mapping[str, str]
    ) -> None:
        counts = self.counts
        counted = [(topic, counts[topic.name]) for topic in topics if topic.name in counts]
        about = bag_metadata({self.path.name: self.span}, counted, custom_data, self._ros)
        self.add_metadata(name, metadata_record(about))
