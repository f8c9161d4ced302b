"""Copies what can be read of a damaged bag to a new one, and joins a recording's parts so.

A file is read up to its first damage: no message comes through that its chunk's CRC denies.
"""

import os
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
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
                file = _File(source)
                copy.take(file, advance)
            if file.damage:
                losses.append(f"{path.name}: {file.damage}")
        copy.writer.finish()
        stream.flush()
        os.fsync(stream.fileno())
    return copy.about, losses


class _Copy:
    """A new MCAP file made of others' messages; channels and schemas stay as they were."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.about: Mapping[str, Any] = {}  # the metadata of the bag
        self.writer = McapWriter(stream, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        self.writer.start(profile=Profile.ROS2, library="sain_bags")
        self._numbers: dict[tuple[Any, ...], int] = {("", "", b""): 0}  # of schemas and channels

    def take(self, file: "_File", advance: Advance) -> None:
        """Copy what can be read of a file."""
        numbers: dict[int, int] = {}  # here, of its channels
        for one in file.records(advance):
            if isinstance(one, Message):
                number, times = numbers[one.channel_id], (one.log_time, one.publish_time)
                self.writer.add_message(number, times[0], one.data, times[1], one.sequence)
            elif isinstance(one, Channel):
                numbers[one.id] = self._number(one, file.schemas[one.schema_id])
            elif isinstance(one, Metadata) and one.name in (METADATA_RECORD, START_RECORD):
                self.about = read_record(one) or self.about
            elif isinstance(one, Metadata):
                self.writer.add_metadata(one.name, one.metadata)
            elif isinstance(one, Attachment):
                kind = (one.name, one.media_type, one.data)
                self.writer.add_attachment(one.create_time, one.log_time, *kind)

    def _number(self, channel: Channel, schema: Schema) -> int:
        """Return the number here of a channel; the same one of several files has one."""
        kind = (schema.name, schema.encoding, schema.data)
        if kind not in self._numbers:
            self._numbers[kind] = self.writer.register_schema(*kind)
        about = (channel.topic, channel.message_encoding, self._numbers[kind])
        key = (*about, *channel.metadata.items())
        if key not in self._numbers:
            self._numbers[key] = self.writer.register_channel(*about, channel.metadata)
        return self._numbers[key]


class _File:
    """Reads one MCAP file up to its first damage."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.damage = ""  # from where on it cannot be read, and why
        self.schemas = {0: Schema(id=0, data=b"", encoding="", name="")}
        self._channels: dict[int, Channel] = {}
        self._stream, self._unpacking = stream, Unpacking(stream.seek(0, 2))
        stream.seek(0)

    def records(self, advance: Advance) -> Iterator[McapRecord]:
        """Yield what is to be copied; a chunk comes whole or not at all."""
        place, last, ended = 0, 0, False
        reader = StreamReader(self._stream, False, True, True, PIECE_BYTES)
        try:
            for record in reader.records:
                ended |= isinstance(record, DataEnd)
                for one in () if ended else self._opened(record):
                    last = max(last, one.log_time) if isinstance(one, Message) else last
                    yield one
                advance(self._stream.tell() - place)
                place = self._stream.tell()
            if self._stream.read(1):
                self.damage = f"not read from byte {place + 8:,} on: bytes follow its end"
        except (DatasetError, *DAMAGE) as error:
            if not ended:  # behind the data is the summary, which is made anew
                after = (
                    f"after the message of {1e-9 * last:.3f} s" if last else "before any message"
                )
                is_cut = isinstance(error, EndOfFile | struct.error)
                why = "the file has no end" if is_cut else error
                self.damage = f"not read from byte {place:,} on, {after}: {why}"

    def _opened(self, record: McapRecord) -> list[McapRecord]:
        """Return the records of a chunk, or the one record; remember what describes messages."""
        found = [record]
        if isinstance(record, Chunk):
            size = record.uncompressed_size
            self._unpacking.take(size)
            record.data = unpack(record.compression.encode(), record.data, size)
            record.compression = ""
            found = breakup_chunk(record, validate_crc=True)
        for one in found:
            if isinstance(one, Message) and one.channel_id not in self._channels:
                raise McapError(f"a message is of channel {one.channel_id}, which is not described")
            if isinstance(one, Channel) and one.schema_id not in self.schemas:
                raise McapError(f"the schema of {one.topic} is missing")
            if isinstance(one, Schema | Channel):
                known: dict[int, Any] = self.schemas if isinstance(one, Schema) else self._channels
                if known.setdefault(one.id, one) != one:
                    raise McapError("it describes a channel otherwise than the file does before")
        return found
