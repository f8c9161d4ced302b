"""Copies the records of an MCAP file to a new one, as far as it describes its messages."""

from typing import IO, Final

from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.well_known import Profile
from mcap.writer import Writer

CHUNK_SIZE: Final = 1 << 20  # [bytes], so that the index of a bag of 10 GB stays small in memory


class McapCopy:
    """A new MCAP file in the making; channels and schemas stay as they were."""

    def __init__(self, stream: IO[bytes]) -> None:
        """Begin an empty file; `writer.finish` ends it."""
        self.writer = Writer(stream, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        self.writer.start(profile=Profile.ROS2, library="sain_bags")
        self._described: dict[tuple[type, int], McapRecord] = {}
        self._numbers: dict[tuple[type, int], int] = {(Schema, 0): 0}  # in the copy

    def add(self, record: McapRecord) -> int:
        """Add a record, with all records of a chunk; return the last time of its messages, or 0."""
        records = breakup_chunk(record) if isinstance(record, Chunk) else [record]
        known = {*self._described, (Schema, 0)}
        for one in records:  # a chunk is copied whole or not at all
            if isinstance(one, Message) and (Channel, one.channel_id) not in known:
                raise McapError(f"a message is of channel {one.channel_id}, which is not described")
            if isinstance(one, Channel) and (Schema, one.schema_id) not in known:
                raise McapError(f"the schema of {one.topic} is missing")
            if isinstance(one, Schema | Channel):
                known.add((type(one), one.id))
                if self._described.setdefault((type(one), one.id), one) != one:
                    raise McapError("it describes a channel otherwise than the file does before")
        return max(map(self._write, records), default=0)

    def _write(self, one: McapRecord) -> int:
        writer, numbers = self.writer, self._numbers
        if isinstance(one, Message):
            number = numbers[Channel, one.channel_id]
            writer.add_message(number, one.log_time, one.data, one.publish_time, one.sequence)
            return one.log_time
        if isinstance(one, Schema) and (Schema, one.id) not in numbers:
            numbers[Schema, one.id] = writer.register_schema(one.name, one.encoding, one.data)
        elif isinstance(one, Channel) and (Channel, one.id) not in numbers:
            about = (one.topic, one.message_encoding, numbers[Schema, one.schema_id], one.metadata)
            numbers[Channel, one.id] = writer.register_channel(*about)
        elif isinstance(one, Metadata):
            writer.add_metadata(one.name, one.metadata)
        elif isinstance(one, Attachment):
            file = (one.name, one.media_type, one.data)
            writer.add_attachment(one.create_time, one.log_time, *file)
        return 0
