"""Copies the records of MCAP files to a new one, as far as each file describes its messages."""

from functools import cache
from typing import IO, Any, Final

from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.well_known import Profile
from mcap.writer import Writer

CHUNK_SIZE: Final = 1 << 20  # [bytes], so that the index of a bag of 10 GB stays small in memory
NO_SCHEMA: Final = Schema(0, b"", "", "")


class McapCopy:
    """A new MCAP file in the making; channels and schemas stay as they were."""

    def __init__(self, stream: IO[bytes]) -> None:
        """Begin an empty file; `writer.finish` ends it."""
        self.writer = writer = Writer(stream, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        writer.start(profile=Profile.ROS2, library="sain_bags")
        # The same schema or channel of several files has one number here.
        self._schema = cache(writer.register_schema)
        self._channel = cache(
            lambda topic, encoding, schema, more: writer.register_channel(
                topic, encoding, schema, dict(more)
            )
        )
        self.begin_file()

    def begin_file(self) -> None:
        """Begin with the records of another file."""
        self._described: dict[tuple[type, int], Any] = {(Schema, 0): NO_SCHEMA}
        self._numbers: dict[int, int] = {}  # of channels, here

    def add(self, record: McapRecord) -> int:
        """Add a record, with all records of a chunk; return the last time of its messages, or 0."""
        records = breakup_chunk(record) if isinstance(record, Chunk) else [record]
        for one in records:
            self._check(one)
        return max(map(self._write, records), default=0)

    def _check(self, one: McapRecord) -> None:
        described = self._described
        if isinstance(one, Message) and (Channel, one.channel_id) not in described:
            raise McapError(f"a message is of channel {one.channel_id}, which is not described")
        if isinstance(one, Channel) and (Schema, one.schema_id) not in described:
            raise McapError(f"the schema of {one.topic} is missing")
        if not isinstance(one, Schema | Channel):
            return
        if described.setdefault((type(one), one.id), one) != one:
            raise McapError("it describes a channel otherwise than the file does before")

    def _write(self, one: McapRecord) -> int:
        writer = self.writer
        if isinstance(one, Message):
            number = self._numbers[one.channel_id]
            writer.add_message(number, one.log_time, one.data, one.publish_time, one.sequence)
            return one.log_time
        if isinstance(one, Channel):
            schema = self._described[Schema, one.schema_id]
            about = self._schema(schema.name, schema.encoding, schema.data)
            more = tuple(one.metadata.items())
            self._numbers[one.id] = self._channel(one.topic, one.message_encoding, about, more)
        elif isinstance(one, Metadata):
            writer.add_metadata(one.name, one.metadata)
        elif isinstance(one, Attachment):
            about = (one.name, one.media_type, one.data)
            writer.add_attachment(one.create_time, one.log_time, *about)
        return 0
