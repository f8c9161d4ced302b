"""Copies what can be read of a damaged bag to a new one, and joins a recording's parts so.

A file is read up to its first damage: no message comes through that its chunk's CRC denies.
"""

import contextlib
import os
import shutil
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any, Final

from mcap.exceptions import EndOfFile, McapError
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.well_known import Profile
from mcap.writer import MCAP0_MAGIC
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
    storage_of,
    whole_span,
    write_metadata,
)
from sain_bags.bag.parts import check_parts, earlier, mcap_files, remove_parts
from sain_bags.mcap.integrity import DAMAGE, Unpacking, unpack
from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.kinds import describe
from sain_core.guarding.untrusted import PARTIAL, PIECE_BYTES, open_regular

ABOUT_BAG: Final = (METADATA_RECORD, START_RECORD)
DEFAULT_DISTRO: Final = "jazzy"
CHUNK_SIZE: Final = 1 << 20  # [bytes], so that the index of a bag of 10 GB stays small in memory

Advance = Callable[[int], object]  # called with the number of bytes that were read


@dataclass
class Recovered:
    """What was copied, and where each damaged file could not be read any more."""

    span: Span = Span()  # of the messages that were copied
    losses: list[str] = field(default_factory=list)
    about: Mapping[str, Any] = field(default_factory=dict)  # the metadata of the bag


def recover(source: Path, out: Path, advance: Advance = lambda done: None) -> Recovered:
    """Copy a bag, each of its files up to the first damage; no bag is made of no message.

    Args:
        source: a bag's folder, also without ``metadata.yaml``, or an MCAP file; it is only read.
        out: the new bag's folder, which must not exist.
        advance: called after each record.

    Raises:
        DatasetError: there is no MCAP file at the source.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists; a bag is never overwritten, choose another")
    files, found = find_parts(source), Recovered()
    partial = out.with_name(f".{out.name}.{os.getpid()}{PARTIAL}")
    try:
        partial.mkdir(parents=True)
    except OSError as error:
        raise OutputError(f"cannot write {partial}: {error.strerror or error}") from error
    try:
        with (partial / f"{out.name}_0.mcap").open("wb") as stream:
            copy = _Copy(stream, found)
            for path in files:
                copy.take(path, advance)
            copy.writer.finish()
            os.fsync(stream.fileno())
        if found.span.messages:
            _complete(found, source, files)
            write_metadata(partial, copy.metadata(Path(stream.name).name, source))
            partial.rename(out)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot recover {source} to {out}: {reason}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return found


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


def _complete(found: Recovered, source: Path, files: tuple[Path, ...]) -> None:
    """Add what ``metadata.yaml`` states, where it can be read."""
    if (source / METADATA_FILE).is_file():
        with contextlib.suppress(DatasetError):  # then the files' own metadata are all there is
            found.about = read_metadata(source)
            names = [path.name for path in files]
            missing = [one for one in found.about["relative_file_paths"] if one not in names]
            found.losses += [f"{name} is not there" for name in missing]


class _Copy:
    """A new MCAP file made of others' messages; channels and schemas stay as they were."""

    def __init__(self, stream: IO[bytes], found: Recovered) -> None:
        self.writer = McapWriter(stream, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        self.writer.start(profile=Profile.ROS2, library="sain_bags")
        self._found = found
        self._numbers: dict[tuple[Any, ...], int] = {}  # here, of schemas and channels
        self._counts: Counter[tuple[str, str]] = Counter()  # messages by topic and type
        self._topics: dict[tuple[str, str], Topic] = {}

    def take(self, path: Path, advance: Advance) -> None:
        """Copy what can be read of a file; where it is damaged, note from where on and why."""
        try:
            stream = open_regular(path)
        except UntrustedFileError as error:
            raise DatasetError(f"{path} is not read: {error}") from error
        with stream:
            file = _File(stream, advance)
            for one in file.records():
                if isinstance(one, Metadata) and one.name in ABOUT_BAG:
                    self._found.about = read_record(one) or self._found.about
                elif isinstance(one, Metadata):
                    self.writer.add_metadata(one.name, one.metadata)
                elif isinstance(one, Attachment):
                    about = (one.create_time, one.log_time, one.name, one.media_type, one.data)
                    self.writer.add_attachment(*about)
                elif isinstance(one, Message):
                    self._message(one, *file.described(one.channel_id))
        for number in file.channels:  # also those without messages
            self._number(*file.described(number))
        if file.damage:
            self._found.losses.append(f"{path.name}: {file.damage}")

    def _message(self, one: Message, channel: Channel, schema: Schema) -> None:
        number = self._number(channel, schema)
        times = one.log_time, one.publish_time
        self.writer.add_message(number, times[0], one.data, times[1], one.sequence)
        self._counts[channel.topic, schema.name] += 1
        self._found.span = whole_span((self._found.span, Span(times[0], times[0], 1)))

    def _number(self, channel: Channel, schema: Schema) -> int:
        """Return the number here of a channel; the same one of several files has one."""
        kind = (schema.name, schema.encoding, schema.data)
        key = (channel.topic, channel.message_encoding, kind, *channel.metadata.items())
        if key not in self._numbers:
            if kind not in self._numbers:
                self._numbers[kind] = self.writer.register_schema(*kind)
            about = (channel.topic, channel.message_encoding, self._numbers[kind])
            self._numbers[key] = self.writer.register_channel(*about, channel.metadata)
            profiles = read_profiles(channel.metadata.get("offered_qos_profiles", ""))
            type_hash = channel.metadata.get("topic_type_hash", "")
            topic = Topic(channel.topic, schema.name, "", type_hash, profiles)
            found = self._topics.setdefault((channel.topic, schema.name), topic)
            merged = tuple(dict.fromkeys((*found.offered_qos, *profiles)))
            self._topics[channel.topic, schema.name] = replace(found, offered_qos=merged)
        return self._numbers[key]

    def metadata(self, name: str, source: Path) -> dict[str, Any]:
        """Return the content of ``metadata.yaml``; its custom data state losses."""
        found, counts = self._found, self._counts
        custom_data = dict(found.about.get("custom_data") or {})
        if found.losses:
            custom_data["recovered"] = f"with losses, from {source.name}"
        counted = [(topic, counts[key]) for key, topic in self._topics.items()]
        distro = found.about.get("ros_distro") or DEFAULT_DISTRO
        return bag_metadata({name: found.span}, counted, custom_data, distro)


class _File:
    """Reads one MCAP file up to its first damage."""

    def __init__(self, stream: IO[bytes], advance: Advance) -> None:
        self.damage = ""  # from where on it cannot be read, and why
        self._stream, self._advance = stream, advance
        self._schemas: dict[int, Schema] = {0: Schema(id=0, data=b"", encoding="", name="")}
        self.channels: dict[int, Channel] = {}
        self._unpacking = Unpacking(stream.seek(0, 2))
        stream.seek(0)

    def described(self, channel: int) -> tuple[Channel, Schema]:
        """Return a channel that was read, and its schema."""
        found = self.channels[channel]
        return found, self._schemas[found.schema_id]

    def records(self) -> Iterator[McapRecord]:
        """Yield what is to be copied; a chunk comes whole or not at all."""
        place = last = 0
        reader = StreamReader(
            self._stream, emit_chunks=True, validate_crcs=True, record_size_limit=PIECE_BYTES
        )
        records = iter(reader.records)
        try:
            for record in records:
                if isinstance(record, DataEnd):
                    self._check_end(records)
                    return
                for one in self._opened(record):
                    last = max(last, one.log_time) if isinstance(one, Message) else last
                    yield one
                self._advance(self._stream.tell() - place)
                place = self._stream.tell()
        except (DatasetError, *DAMAGE) as error:
            if isinstance(error, EndOfFile | struct.error):
                error = McapError("the file has no end")
            elif isinstance(error, CRCValidationError) and isinstance(error.record, DataEnd):
                self.damage = "a record outside of chunks is damaged: the CRC of the data is wrong"
                return
            after = f"after the message of {1e-9 * last:.3f} s" if last else "before any message"
            self.damage = f"not read from byte {place:,} on, {after}: {error}"

    def _check_end(self, summary: Iterator[McapRecord]) -> None:
        """Note what stands behind the end, as where files were joined; damage there is no loss."""
        with contextlib.suppress(DatasetError, *DAMAGE):
            if any(isinstance(one, Footer) for one in summary):
                end = self._stream.tell() + len(MCAP0_MAGIC)
                if (more := self._stream.seek(0, 2) - end) > 0:
                    self.damage = f"not read from byte {end:,} on: {more:,} bytes behind its end"

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
            if isinstance(one, Message) and one.channel_id not in self.channels:
                raise McapError(f"a message is of channel {one.channel_id}, which is not described")
            if isinstance(one, Schema | Channel):
                self._describe(one)
        return found

    def _describe(self, one: Schema | Channel) -> None:
        known: dict[int, Any] = self._schemas if isinstance(one, Schema) else self.channels
        if isinstance(one, Channel) and one.schema_id not in self._schemas:
            raise McapError(f"the schema of {one.topic} is missing")
        if known.setdefault(one.id, one) != one:
            raise McapError("it describes a channel otherwise than the file does before")


def set_aside(folder: Path) -> Path | None:
    """Make room for a bag where a recording was cut off; return where that is now; None: nowhere.

    Raises:
        OutputError: there is a whole bag, or something else that is no recording.
    """
    aside = earlier(folder)
    try:
        check_parts(aside, folder.name)
        check_parts(folder, folder.name)
        if folder.exists():
            _move_files(folder, aside)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot go on with {folder}: {error.strerror or error}") from error
    return aside if aside.exists() else None


def join(aside: Path, folder: Path, advance: Advance = lambda done: None) -> None:
    """Put what was set aside before a recording that went on with it and wrote no metadata.

    `advance` is called with the number of bytes that were read, after each record.

    Raises:
        OutputError, DatasetError: it fails; all that was recorded is still there.
    """
    try:
        check_parts(folder, folder.name)
        _move_files(folder, aside)
        if not recover(aside, folder, advance).span.messages:
            raise OutputError(f"there is no message in the parts in {aside}; they are left")
        remove_parts(aside, folder.name)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot join {aside} and {folder}: {error.strerror or error}") from error


def _move_files(folder: Path, aside: Path) -> None:
    """Move the files of a recording behind those that are aside already, and remove its folder."""
    aside.mkdir(exist_ok=True)
    numbers = [int(path.stem.rpartition("_")[2]) for path in mcap_files(aside)]
    for number, path in enumerate(mcap_files(folder), start=max(numbers, default=-1) + 1):
        path.rename(aside / f"{folder.name}_{number}.mcap")
    remove_parts(folder, folder.name)
