"""Writes bags: a folder with one MCAP file and ``metadata.yaml``, as rosbag2 lays it out.

A bag is whole when ``metadata.yaml`` stands, and that is written last, in one move. While it is
being recorded, or after a crash, the folder holds an MCAP file without an end and no metadata:
rosbag2 and its readers refuse such a folder, and what was flushed (`BagConfig.flush_period`)
can still be recovered from the file.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from sain_bags.metadata import Span, Topic, bag_metadata, write_metadata
from sain_bags.reserve import ReservedFile
from sain_core.config import Config, option
from sain_core.errors import InvalidInputError, OutputError

LIBRARY: Final = "sain_bags"


@dataclass(frozen=True)
class BagConfig(Config):
    """How a bag is written."""

    compression: str = option("zstd", "of each chunk", choices=("none", "lz4", "zstd"))
    chunk_size: int = option(256 << 10, "chunks end at this size", unit="B", minimum=1 << 10)
    flush_period: float = option(
        1.0, "at most this much is lost in a crash", unit="s", minimum=0.01, maximum=60.0
    )


class BagWriter:
    """Writes one bag. Use it as a context manager; leaving it makes the bag whole."""

    def __init__(
        self,
        folder: Path,
        config: BagConfig = BagConfig(),
        custom_data: Mapping[str, str] | None = None,
        ros_distro: str = "jazzy",
    ) -> None:
        """Create the folder and the MCAP file in it.

        Raises:
            OutputError: the folder exists, or cannot be written.
        """
        self.folder = folder
        self._config = config
        self._custom_data = dict(custom_data or {})
        self._ros_distro = ros_distro
        self._topics: dict[str, Topic] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._span = Span()
        self._closed = False
        self._flushed_at = time.monotonic()
        self._file = _create(folder)
        self._mcap = McapWriter(
            self._file,  # type: ignore[arg-type]  # write, tell and flush are all that is used
            chunk_size=config.chunk_size,
            compression=CompressionType[config.compression.upper()],
            enable_data_crcs=True,
        )
        self._mcap.start(profile=Profile.ROS2, library=LIBRARY)

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return dict(self._counts)

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic, or say more about one: the offered profiles of later publishers."""
        if topic.name not in self._topics:
            schema = self._schemas.get(topic.type)
            if schema is None:
                schema = self._mcap.register_schema(
                    topic.type, SchemaEncoding.ROS2, topic.definition.encode()
                )
                self._schemas[topic.type] = schema
            about = {
                "offered_qos_profiles": topic.qos_text(),
                "topic_type_hash": topic.type_hash,
            }
            self._channels[topic.name] = self._mcap.register_channel(
                topic.name, MessageEncoding.CDR, schema, about
            )
            self._counts[topic.name] = 0
        self._topics[topic.name] = topic

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
        try:
            self._mcap.add_message(
                channel, received, data, published or received, sequence & 0xFFFFFFFF
            )
        except OSError as error:
            raise _output_error(self.folder, error) from error
        self._counts[topic] += 1
        first = min(self._span.start, received) if self._span.messages else received
        self._span = Span(first, max(self._span.end, received), self._span.messages + 1)
        if time.monotonic() - self._flushed_at >= self._config.flush_period:
            self.flush()
        else:
            self._check_space()

    def flush(self) -> None:
        """Hand everything written so far to the operating system.

        Raises:
            OutputError: the disk is full or failed. The bag can, and should, still be closed.
        """
        self._flushed_at = time.monotonic()
        try:
            self._mcap.flush()
        except OSError as error:
            raise _output_error(self.folder, error) from error
        self._check_space()

    def close(self) -> None:
        """Make the bag whole: end the file, then write ``metadata.yaml``.

        Raises:
            OutputError: the disk failed, and the bag is not whole.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._mcap.finish()
            self._file.close()
            topics = [(topic, self._counts[name]) for name, topic in self._topics.items()]
            name = self._file.path.name
            metadata = bag_metadata(name, self._span, topics, self._custom_data, self._ros_distro)
            write_metadata(self.folder, metadata)
        except OSError as error:
            raise _output_error(self.folder, error) from error

    def __enter__(self) -> "BagWriter":
        """Return the writer."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Make the bag whole, also after an error elsewhere: what was recorded is true."""
        self.close()

    def _check_space(self) -> None:
        if self._file.full:
            raise OutputError(f"no space left for the bag {self.folder}; close it")


def _create(folder: Path) -> ReservedFile:
    try:
        folder.mkdir(parents=True)
    except FileExistsError as error:
        raise OutputError(f"{folder} exists; a bag is never overwritten, choose another") from error
    except OSError as error:
        raise _output_error(folder, error) from error
    try:
        return ReservedFile(folder / f"{folder.name}_0.mcap")
    except OSError as error:
        folder.rmdir()
        raise _output_error(folder, error) from error


def _output_error(folder: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot write the bag {folder}: {error.strerror or error}")
