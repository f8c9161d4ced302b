"""Writes bags: a folder with MCAP files and ``metadata.yaml``, as rosbag2 lays it out.

A bag is whole when ``metadata.yaml`` stands, and that is written last, in one move. While it is
being recorded, or after a crash, the folder holds an MCAP file without an end and no metadata:
rosbag2 and its readers refuse such a folder, and what was flushed (`BagConfig.flush_period`)
can still be recovered from the file.
"""

import shutil
import time
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_bags.bag.metadata import Topic, bag_metadata, write_metadata
from sain_bags.bag.parts import mcap_files
from sain_bags.mcap.integrity import rescue
from sain_bags.writing.split_file import SplitFile
from sain_core.config import Config, option
from sain_core.errors import InvalidInputError, OutputError

EARLY: Final = 0.9  # of the flush period: flushing takes a moment, too
HELD_OF_SEVERAL: Final = 64  # latched messages, where publishers are several: each may be anyone's
WORD: Final = 0xFFFFFFFF  # sequence numbers have 32 bits in MCAP


@dataclass(frozen=True)
class BagConfig(Config):
    """How a bag is written."""

    compression: str = option("zstd", "compression of each chunk", choices=("none", "lz4", "zstd"))
    chunk_size: int = option(256 << 10, "size of a chunk", unit="B", minimum=1 << 10)
    flush_period: float = option(
        1.0,
        "longest time until messages are written; the largest loss in a crash",
        unit="s",
        minimum=0.01,
        maximum=60.0,
    )
    split_size: int = option(0, "size after which a new file begins; 0: never", unit="B", minimum=0)
    split_duration: float = option(
        0.0, "time after which a new file begins; 0: never", unit="s", minimum=0.0
    )
    min_free_space: int = option(
        64 << 20,
        "free disk space below which the recording ends with an error",
        unit="B",
        minimum=0,
    )


class BagWriter:
    """Writes one bag. Use it as a context manager; leaving it makes the bag whole."""

    def __init__(
        self,
        folder: Path,
        config: BagConfig = BagConfig(),
        custom_data: Mapping[str, str] | None = None,
        ros_distro: str = "jazzy",
        resumes: bool = False,
    ) -> None:
        """Create the folder and the first MCAP file in it.

        A recording that resumes writes its files behind those that are there, which may be cut off,
        and no ``metadata.yaml``: `make_whole` does, once it mended those.

        Raises:
            OutputError: the folder exists, or cannot be written.
        """
        self.folder = folder
        self.custom_data = dict(custom_data or {})  # may be added to until the bag is closed
        self._config = config
        self._splits = config.split_size > 0 or config.split_duration > 0.0
        self._ros_distro, self._resumes = ros_distro, resumes
        earlier = mcap_files(folder) if resumes else ()
        numbers = [int(path.stem.rpartition("_")[2]) for path in earlier]
        self._first_number = max(numbers, default=-1) + 1
        self._topics: dict[str, Topic] = {}
        self._channels: dict[str, int] = {}  # in the file
        self._counts: dict[str, int] = {}
        self._latched: dict[str, deque[tuple[int, int, bytes]]] = {}  # the last messages
        self.first: int | None = None  # [ns since the epoch], when its first message was received
        self._file_start = 0  # [ns since the epoch], its first message; 0: it has none yet
        self._flush_at: float | None = None  # by `time.monotonic`; None: just flushed
        self._closed = False
        # Earlier files are ended on a thread of their own: messages do not wait for the disk.
        self._finisher = ThreadPoolExecutor(1, "finisher")
        self._finished: list[Future[None]] = []
        self.files: list[SplitFile] = []
        self._file = self._create()
        self.files.append(self._file)

    @property
    def size(self) -> int:
        """Size of all files, with what waits to be written [bytes]."""
        return sum(file.size for file in self.files)

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic; what was repeated in a later file counts once."""
        return dict(self._counts)

    def add_topic(self, topic: Topic) -> None:
        """Add a topic, or update it with the offered profiles of later publishers."""
        self._topics[topic.name] = topic
        self._counts.setdefault(topic.name, 0)
        if topic.is_latched or topic.name in self._latched:
            depth = HELD_OF_SEVERAL if topic.publishers > 1 else 1
            self._latched[topic.name] = deque(self._latched.get(topic.name, ()), maxlen=depth)
        self._channels[topic.name] = self._file.channel(topic)

    def write(
        self,
        topic: str,
        data: bytes,
        received: int,
        published: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Append one message.

        Args:
            topic: one that was added.
            data: the message in CDR, with its encapsulation header.
            received: when it was received [ns since the epoch], its log time.
            published: when it was published [ns since the epoch]; None: not known.
            sequence: the publisher's count of its messages, 0: not known.

        Raises:
            InvalidInputError: the topic was not added.
            OutputError: the disk is full or failed. The bag can, and should, still be closed.
        """
        channel = self._channels.get(topic)
        if channel is None:
            raise InvalidInputError(f"topic {topic!r} was not added to the bag")
        published = published or received
        sequence &= WORD
        try:
            if self._splits and self._is_file_done(received):
                self._split(received)
                channel = self._channels[topic]
            self._file.add_message(channel, sequence, received, published, data)
        except OSError as error:
            raise self._error(error) from error
        if not self._file_start:
            self._file_start = received
            self.first = self.first or received
        self._counts[topic] += 1
        if topic in self._latched:
            self._latched[topic].append((sequence, published, data))
        if self._file.full:
            self._check()

    def flush_if_due(self) -> None:
        """Flush when the flush period is over; call this also while no message comes."""
        now, period = time.monotonic(), EARLY * self._config.flush_period
        self._flush_at = now + period if self._flush_at is None else self._flush_at
        if now >= self._flush_at:
            self.flush()

    def flush(self) -> None:
        """Hand everything written so far to the operating system.

        Raises:
            OutputError: the disk is full, nearly full or failed. The bag should still be closed.
        """
        self._flush_at = None
        try:
            self._file.end_chunks()
            self._check()
        except OSError as error:
            raise self._error(error) from error

    def close(self) -> None:
        """Make the bag whole: end the file, then write ``metadata.yaml``.

        Raises:
            OutputError: the disk failed; the bag may be whole nevertheless, without its last chunk.
        """
        if self._closed:
            return
        self._closed = True
        self._finish(self._file)
        self._finisher.shutdown()
        failures = [error for done in self._finished if (error := done.exception())]
        try:
            if self._are_whole and not self._resumes:
                spans = {file.path.name: file.span for file in self.files}
                topics = [
                    (topic, sum(file.counts.get(name, 0) for file in self.files))
                    for name, topic in self._topics.items()
                ]
                about = bag_metadata(spans, topics, self.custom_data, self._ros_distro)
                write_metadata(self.folder, about)
        except OSError as error:
            failures.append(error)
        for failure in failures:
            if isinstance(failure, OSError):
                raise self._error(failure) from failure
            raise failure

    def __enter__(self) -> "BagWriter":
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Make the bag whole, also after an error elsewhere: what was recorded is valid."""
        self.close()

    def _is_file_done(self, received: int) -> bool:
        config = self._config
        if not self._file_start:
            return False
        if 0 < config.split_size <= self._file.size:
            return True
        return 0.0 < config.split_duration <= 1e-9 * (received - self._file_start)

    def _split(self, received: int) -> None:
        """Begin another file, which repeats what latched topics hold; end this one meanwhile."""
        file = self._begin_file()
        self._file.end_chunks()  # else a flush would not hand them on, nor wait for the finisher
        self._finish(self._file)
        self.files.append(file)
        self._file, self._file_start, self._flush_at = file, 0, None
        self._channels = {name: file.channel(topic) for name, topic in self._topics.items()}
        for topic, messages in self._latched.items():
            for sequence, published, data in messages:
                file.add_message(self._channels[topic], sequence, received, published, data)

    def _finish(self, file: SplitFile) -> None:
        """Begin to end a file."""
        about = (tuple(self._topics.values()), dict(self.custom_data))
        self._finished.append(self._finisher.submit(file.close, *about))

    @property
    def _are_whole(self) -> bool:
        return all(file.whole for file in self.files)

    def _begin_file(self) -> SplitFile:
        number = self._first_number + len(self.files)
        path = self.folder / f"{self.folder.name}_{number}.mcap"
        about = (self.custom_data, self._ros_distro)
        return SplitFile(path, self._config.compression, self._config.chunk_size, *about)

    def _check(self) -> None:
        if self._file.full:
            raise OutputError(f"no space left for the bag {self.folder}: nothing more is recorded")
        for done in self._finished:
            if done.done():
                done.result()  # raises where an earlier file could not be ended
        self._check_free_space()

    def _check_free_space(self) -> None:
        free, least = shutil.disk_usage(self.folder).free, self._config.min_free_space
        if free < least:
            raise OutputError(
                f"only {free / 1e6:,.1f} MB are left on the disk for the bag {self.folder};"
                f" {least / 1e6:,.1f} MB must stay free (--bag.min-free-space)"
            )

    def _create(self) -> SplitFile:
        folder = self.folder
        try:
            folder.mkdir(parents=True, exist_ok=self._resumes)
            try:
                self._check_free_space()
                return self._begin_file()
            except BaseException:
                if not self._first_number:
                    folder.rmdir()
                raise
        except FileExistsError as error:
            message = f"{folder} exists; a bag is never overwritten, choose another"
            raise OutputError(message) from error
        except OSError as error:
            raise self._error(error) from error

    def _error(self, error: OSError) -> OutputError:
        if isinstance(error, OutputError):
            return error
        broken = self._closed and not self._are_whole
        advice = f"; {rescue(self.folder)}" if broken else ""
        return OutputError(f"cannot write the bag {self.folder}: {error.strerror or error}{advice}")
