"""A new bag made of another's raw messages: channels and schemas stay as they were.

It is written beside its place and moved there when it is whole.
"""

import contextlib
import os
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.well_known import Profile
from mcap.writer import Writer as McapWriter

from sain_bags.bag.metadata import Span, Topic, bag_metadata, read_profiles, write_metadata
from sain_core.errors import OutputError
from sain_core.guarding.untrusted import PARTIAL

CHUNK_SIZE: Final = 1 << 20  # [bytes], so that the index of a bag of 10 GB stays small in memory
LIBRARY: Final = "sain_bags"
EMPTY: Final = Schema(id=0, data=b"", encoding="", name="")


class BagCopy:
    """Use it as a context manager; without `finish` nothing is left behind.

    Every method raises `OSError` where the disk fails.
    """

    def __init__(self, folder: Path) -> None:
        """Begin a bag.

        Raises:
            OutputError: the folder exists.
        """
        if os.path.lexists(folder):
            raise OutputError(f"{folder} exists; a bag is never overwritten, choose another")
        self.folder = folder
        self.counts: dict[str, int] = {}  # messages by topic
        self.span = Span()
        self._partial = folder.with_name(f".{folder.name}.{os.getpid()}{PARTIAL}")
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[str, str, int, tuple[tuple[str, str], ...]], int] = {}
        self._topics: dict[int, tuple[Channel, Schema]] = {}
        self._partial.mkdir(parents=True)
        self._file = (self._partial / f"{folder.name}_0.mcap").open("wb")
        self._mcap = McapWriter(self._file, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        self._mcap.start(profile=Profile.ROS2, library=LIBRARY)

    def add_channel(self, channel: Channel, schema: Schema | None) -> int:
        """Take on a channel and return its number here; the same one gets the same number."""
        schema = schema or EMPTY
        schema_key = (schema.name, schema.encoding, schema.data)
        if schema is not EMPTY and schema_key not in self._schemas:
            self._schemas[schema_key] = self._mcap.register_schema(
                schema.name, schema.encoding, schema.data
            )
        number = self._schemas.get(schema_key, 0)
        about = tuple(channel.metadata.items())
        key = (channel.topic, channel.message_encoding, number, about)
        if key not in self._channels:
            added = self._mcap.register_channel(
                channel.topic, channel.message_encoding, number, channel.metadata
            )
            self._channels[key] = added
            self._topics[added] = (channel, schema)
            self.counts.setdefault(channel.topic, 0)
        return self._channels[key]

    def write(
        self, channel: int, sequence: int, received: int, published: int, data: bytes
    ) -> None:
        """Append one message, its times in [ns since the epoch]."""
        self._mcap.add_message(channel, received, data, published, sequence)
        self.counts[self._topics[channel][0].topic] += 1
        first = min(self.span.start, received) if self.span.messages else received
        self.span = Span(first, max(self.span.end, received), self.span.messages + 1)

    def add_extra(self, record: Attachment | Metadata) -> None:
        """Append an attachment, or metadata that a file carries."""
        if isinstance(record, Metadata):
            self._mcap.add_metadata(record.name, record.metadata)
        else:
            self._mcap.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )

    def finish(self, custom_data: Mapping[str, str], ros_distro: str) -> None:
        """Make the bag whole and move it to its place."""
        topics: dict[str, Topic] = {}
        for channel, schema in self._topics.values():
            profiles = read_profiles(channel.metadata.get("offered_qos_profiles", ""))
            type_hash = channel.metadata.get("topic_type_hash", "")
            topic = Topic(channel.topic, schema.name, "", type_hash, profiles)
            found = topics.setdefault(channel.topic, topic)
            merged = tuple(dict.fromkeys((*found.offered_qos, *profiles)))
            topics[channel.topic] = replace(found, offered_qos=merged)
        counted = [(topic, self.counts[name]) for name, topic in topics.items()]
        name = Path(self._file.name).name
        self._mcap.finish()
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        metadata = bag_metadata({name: self.span}, counted, custom_data, ros_distro)
        write_metadata(self._partial, metadata)
        self._partial.rename(self.folder)

    def __enter__(self) -> "BagCopy":
        """Return the copy."""
        return self

    def __exit__(self, *_: object) -> None:
        """Remove what was not finished."""
        with contextlib.suppress(OSError):  # what is still to be written is given up
            self._file.close()
        shutil.rmtree(self._partial, ignore_errors=True)
