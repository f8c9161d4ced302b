"""The files of a bag: one is open; earlier ones are ended in the background."""

from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
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
    """A file that is written by topic. Every method raises `OSError` where the disk fails."""

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


class SplitFiles:
    """Ends files on a thread of its own, so that messages do not wait for the disk."""

    def __init__(self) -> None:
        """Begin without a file."""
        self._files: list[SplitFile] = []
        self._finisher = ThreadPoolExecutor(1, "finisher")
        self._finished: list[Future[None]] = []

    def __len__(self) -> int:
        """Return the number of files."""
        return len(self._files)

    @property
    def size(self) -> int:
        """Size of all files, with what waits to be written [bytes]."""
        return sum(file.size for file in self._files)

    @property
    def spans(self) -> dict[str, Span]:
        """When the messages of each file were received, by its name."""
        return {file.path.name: file.span for file in self._files}

    @property
    def are_whole(self) -> bool:
        """Whether all were ended, and all that is in them can be read."""
        return all(file.whole for file in self._files)

    def counts(self, topics: Iterable[str]) -> dict[str, int]:
        """Return the messages in all files, by topic."""
        counts = dict.fromkeys(topics, 0)
        for file in self._files:
            for name, count in file.counts.items():
                counts[name] += count
        return counts

    def add(self, file: SplitFile) -> None:
        """Add the next file."""
        self._files.append(file)

    def finish_last(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        """Begin to end the file that was added last."""
        file = self._files[-1]
        done = self._finisher.submit(file.close, tuple(topics), dict(custom_data))
        self._finished.append(done)

    def check(self) -> None:
        """Raise `OSError` when an earlier file could not be ended."""
        for done in self._finished:
            if done.done():
                done.result()

    def close(self) -> list[BaseException]:
        """Wait until all files are ended; return what went wrong."""
        self._finisher.shutdown()
        return [error for done in self._finished if (error := done.exception())]
