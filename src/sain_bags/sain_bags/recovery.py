"""Copies what can be read of a damaged bag to a new one, and joins a recording's parts so.

A file is read up to its first damage: no message comes through that its chunk's CRC denies.
"""

import os
import struct
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, Final

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.well_known import Profile
from mcap.writer import Writer as McapWriter

from sain_bags.bag.metadata import (
    METADATA_FILE,
    METADATA_RECORD,
    START_RECORD,
    Span,
    Topic,
    bag_metadata,
    read_metadata,
    read_profiles,
    read_record,
    span_of,
    storage_of,
    write_metadata,
)
from sain_bags.bag.parts import check_parts, earlier, mcap_files, move_files, remove_parts
from sain_bags.mcap.integrity import DAMAGE, Unpacking, unpack
from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.kinds import describe
from sain_core.guarding.untrusted import PIECE_BYTES, open_regular

CHUNK_SIZE: Final = 1 << 20  # [bytes], so that the index of a bag of 10 GB stays small in memory
CUT_OFF: Final = (EndOfFile, struct.error, StopIteration)  # before the record that ends the data

Advance = Callable[[int], object]  # called with the number of bytes that were read


@dataclass(frozen=True)
class Recovered:
    """What was copied, and where each damaged file could not be read any more."""

    span: Span  # of the messages that were copied
    losses: list[str]


def recover(source: Path, out: Path, advance: Advance = lambda done: None) -> Recovered:
    """Copy a bag, each of its files up to the first damage; no bag is made of no message.

    Raises:
        DatasetError: there is no MCAP file at the source.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists; a bag is never overwritten, choose another")
    files = find_parts(source)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(".partial", f".{out.name}.", out.parent) as place:
            file = Path(place) / out.name / f"{out.name}_0.mcap"
            file.parent.mkdir()
            about, losses = _copy(files, file, advance)
            with suppress(DatasetError):  # then the files' own metadata are all there is
                about = read_metadata(source)
                missing = {*about["relative_file_paths"]} - {path.name for path in files}
                losses += [f"{name} is not there" for name in sorted(missing)]
            notes = {"recovered": f"with losses, from {source.name}"} if losses else {}
            span = _describe(file, about, notes)
            if span.messages:
                file.parent.rename(out)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot recover {source} to {out}: {reason}") from error
    return Recovered(span, losses)


def find_parts(source: Path) -> tuple[Path, ...]:
    """Return the MCAP files of a bag; of one that was not closed, also those it goes on with.

    Raises:
        DatasetError: there is no such file.
    """
    for path in (source, *sorted(source.glob("*.db3"))):
        if path.is_file() and storage_of(path) != "mcap":
            raise DatasetError(f"{path} is a sqlite3 file; `sqlite3 FILE .recover` saves those")
    if source.is_file():
        return (source,)
    files = mcap_files(source)
    if not (source / METADATA_FILE).is_file():
        files = (*mcap_files(earlier(source)), *files)
    if not files:
        what = f"; it {found}" if (found := describe(source)) else ""
        raise DatasetError(f"there is no MCAP file at {source}{what}")
    return files


def join(aside: Path, folder: Path, advance: Advance = lambda done: None) -> None:
    """Put what was set aside before a recording that went on with it and wrote no metadata.

    Raises:
        OutputError, DatasetError: it fails; all that was recorded is still there.
    """
    try:
        check_parts(folder, folder.name)
        move_files(folder, aside)
        if not recover(aside, folder, advance).span.messages:
            raise OutputError(f"there is no message in the parts in {aside}; they are left")
        remove_parts(aside, folder.name)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot join {aside} and {folder}: {error.strerror or error}") from error


def _describe(file: Path, about: Mapping[str, Any], notes: Mapping[str, str]) -> Span:
    """Write the ``metadata.yaml`` of a bag of one file; return the span of its messages."""
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None and summary.statistics is not None
    counts: Counter[tuple[str, str]] = Counter()
    topics: dict[tuple[str, str], Topic] = {}
    for number, channel in summary.channels.items():
        schema, more = summary.schemas.get(channel.schema_id), channel.metadata
        key = (channel.topic, schema.name if schema else "")
        profiles = read_profiles(more.get("offered_qos_profiles", ""))
        topics[key] = Topic(*key, "", more.get("topic_type_hash", ""), profiles)
        counts[key] += summary.statistics.channel_message_counts.get(number, 0)
    span, counted = span_of(summary.statistics), [(topics[key], counts[key]) for key in topics]
    custom_data = {**(about.get("custom_data") or {}), **notes}
    distro = about.get("ros_distro") or "jazzy"
    write_metadata(file.parent, bag_metadata({file.name: span}, counted, custom_data, distro))
    return span


def _copy(
    files: tuple[Path, ...], target: Path, advance: Advance
) -> tuple[Mapping[str, Any], list[str]]:
    """Copy what can be read of files; return the metadata of the bag, and what was lost."""
    losses = []
    with target.open("wb") as stream:
        copy = _Copy(stream)
        for path in files:
            try:
                source = open_regular(path)
            except UntrustedFileError as error:
                raise DatasetError(f"{path} is not read: {error}") from error
            with source:
                if damage := copy.take(source, advance):
                    losses.append(f"{path.name}: {damage}")
        copy.writer.finish()
        stream.flush()
        os.fsync(stream.fileno())
    return copy.about, losses


class _Copy:
    """A new MCAP file made of others' messages; channels and schemas stay as they were."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.about: Mapping[str, Any] = {}  # the metadata of the bag
        self.writer = writer = McapWriter(stream, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        self.writer.start(profile=Profile.ROS2, library="sain_bags")
        # The same schema or channel of several files has one number here.
        self._schema = cache(writer.register_schema)
        self._channel = cache(
            lambda topic, encoding, schema, more: writer.register_channel(
                topic, encoding, schema, dict(more)
            )
        )

    def take(self, stream: IO[bytes], advance: Advance) -> str:
        """Copy a file up to its first damage; return where and what that is; empty: none."""
        known: dict[tuple[type, int], Any] = {(Schema, 0): Schema(0, b"", "", "")}
        unpacking, place, last = Unpacking(stream.seek(0, 2)), stream.seek(0), 0
        records = iter(StreamReader(stream, False, True, True, PIECE_BYTES).records)
        while True:
            try:
                record = next(records)
                found = _opened(record, known, unpacking)
            except (DatasetError, *CUT_OFF, *DAMAGE) as error:
                why = "the file has no end" if isinstance(error, CUT_OFF) else error
                last_message = f"after the message of {1e-9 * last:.3f} s"
                when = last_message if last else "before any message"
                return f"not read from byte {place:,} on, {when}: {why}"
            if isinstance(record, DataEnd):
                return _check_end(stream, records)
            for one in found:
                self._add(one, known)
                last = max(last, one.log_time) if isinstance(one, Message) else last
            advance(stream.tell() - place)
            place = stream.tell()

    def _add(self, one: McapRecord, known: Mapping[tuple[type, int], Any]) -> None:
        if isinstance(one, Message | Channel):
            channel = known[Channel, one.channel_id if isinstance(one, Message) else one.id]
            schema = known[Schema, channel.schema_id]
            about = self._schema(schema.name, schema.encoding, schema.data)
            more = tuple(channel.metadata.items())
            number = self._channel(channel.topic, channel.message_encoding, about, more)
        if isinstance(one, Message):
            self.writer.add_message(number, one.log_time, one.data, one.publish_time, one.sequence)
        elif isinstance(one, Metadata) and one.name in (METADATA_RECORD, START_RECORD):
            self.about = read_record(one) or self.about
        elif isinstance(one, Metadata):
            self.writer.add_metadata(one.name, one.metadata)
        elif isinstance(one, Attachment):
            about = (one.name, one.media_type, one.data)
            self.writer.add_attachment(one.create_time, one.log_time, *about)


def _check_end(stream: IO[bytes], summary: Iterator[McapRecord]) -> str:
    """Return what stands behind the end, as where files were joined; damage there is no loss."""
    with suppress(*DAMAGE):
        deque(summary, maxlen=0)
        if stream.read(1):
            return f"not read from byte {stream.tell() - 1:,} on: bytes follow its end"
    return ""


def _opened(
    record: McapRecord, known: dict[tuple[type, int], Any], unpacking: Unpacking
) -> list[McapRecord]:
    """Return the records of a chunk, whole, or the one; add what describes messages to `known`."""
    found = [record]
    if isinstance(record, Chunk):
        unpacking.take(size := record.uncompressed_size)
        record.data = unpack(record.compression.encode(), record.data, size)
        record.compression = ""
        found = breakup_chunk(record, validate_crc=True)
    for one in found:
        if isinstance(one, Message) and (Channel, one.channel_id) not in known:
            raise McapError(f"a message is of channel {one.channel_id}, which is not described")
        if isinstance(one, Channel) and (Schema, one.schema_id) not in known:
            raise McapError(f"the schema of {one.topic} is missing")
        if isinstance(one, Schema | Channel) and known.setdefault((type(one), one.id), one) != one:
            raise McapError("it describes a channel otherwise than the file does before")
    return found
