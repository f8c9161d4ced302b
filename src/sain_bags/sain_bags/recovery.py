"""Copies what can be read of a damaged bag to a new one, and makes a resumed recording whole so.

A file is read up to its first damage: no message comes through that its chunk's CRC denies.
"""

import os
import struct
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, Final

from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader

from sain_bags.bag.metadata import (
    METADATA_RECORD,
    START_RECORD,
    Span,
    Topic,
    bag_metadata,
    find_parts,
    read_metadata,
    read_record,
    span_of,
    topic_of,
    whole_span,
    write_metadata,
)
from sain_bags.bag.parts import WHOLE, check_parts, mcap_files
from sain_bags.mcap.copying import McapCopy
from sain_bags.mcap.integrity import DAMAGE, opened, read_data
from sain_bags.mcap.mcap_file import McapFile
from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.untrusted import open_regular

CUT_OFF: Final = (EndOfFile, struct.error)  # before the record that ends the data

Advance = Callable[[int], object]  # called with the number of bytes that were read
About = dict[str, Any]  # the metadata of a bag, as far as they are read


@dataclass(frozen=True)
class Recovered:
    """What was copied, and where each damaged file could not be read any more."""

    span: Span  # of the messages that were copied
    losses: list[str]


def recover(source: Path, out: Path, advance: Advance = lambda done: None) -> Recovered:
    """Copy a bag, each of its files up to the first damage; no bag is made of no message.

    Raises:
        DatasetError: there is no MCAP file at the source, or it has more than SAIN reads.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists; a bag is never overwritten, choose another")
    files, about, losses = find_parts(source), About(), list[str]()
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(".partial", f".{out.name}.", out.parent) as place:
            folder = Path(place) / out.name
            folder.mkdir()
            for number, file in enumerate(files):
                losses += _copy(file, folder / f"{out.name}_{number}.mcap", about, advance)
            with suppress(DatasetError):  # then the files' own metadata are all there is
                about = read_metadata(source)
                missing = {*about["relative_file_paths"]} - {path.name for path in files}
                losses += [f"{name} is not there" for name in sorted(missing)]
            notes = {"recovered": f"with losses, from {source.name}"} if losses else {}
            try:
                span = _describe(folder, about, notes)
            except DatasetError as error:  # it names the copy, which is not there any more
                raise DatasetError(f"{source} is not recovered: {error.__cause__}") from error
            if span.messages:
                folder.rename(out)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot recover {source} to {out}: {reason}") from error
    return Recovered(span, losses)


def make_whole(folder: Path, advance: Advance = lambda done: None) -> None:
    """Make one bag of the files of a recording that was resumed, each up to where it was cut off.

    Raises:
        OutputError, DatasetError: it fails; all that was recorded is still there.
    """
    about = About()
    try:
        check_parts(folder)
        for file in mcap_files(folder):
            try:
                McapFile(file)
            except DatasetError:  # it has no end
                part = folder / f".{file.name}{WHOLE}"
                _copy(file, part, about, advance)
                part.replace(file)
            else:
                with opened(file) as stream:
                    for record in make_reader(stream).iter_metadata():
                        about.update(read_record(record))
        _describe(folder, about, {})
    except OSError as error:
        raise OutputError(f"cannot make {folder} whole: {error.strerror or error}") from error


def _describe(folder: Path, about: Mapping[str, Any], notes: Mapping[str, str]) -> Span:
    """Write the ``metadata.yaml`` of whole files; return the span of their messages."""
    spans, counts, topics = dict[str, Span](), Counter[tuple[str, str]](), dict[Any, Topic]()
    for path in mcap_files(folder):
        file = McapFile(path)
        spans[path.name] = span_of(file.statistics)
        for number, channel in file.channels.items():
            topic = topic_of(channel, file.schemas.get(channel.schema_id))
            key = topic.name, topic.type
            before = topics.get(key, topic).offered_qos
            profiles = tuple(dict.fromkeys((*before, *topic.offered_qos)))
            topics[key] = replace(topic, offered_qos=profiles)
            counts[key] += file.statistics.channel_message_counts.get(number, 0)
    custom_data = {**(about.get("custom_data") or {}), **notes}
    counted = [(topic, counts[key]) for key, topic in topics.items()]
    distro = about.get("ros_distro") or "jazzy"
    write_metadata(folder, bag_metadata(spans, counted, custom_data, distro))
    return whole_span(spans.values())


def _copy(path: Path, target: Path, about: About, advance: Advance) -> list[str]:
    """Copy a file up to its first damage, add what it says of the bag to `about`.

    Returns:
        where and what the damage is, if any.
    """
    try:
        source = open_regular(path)
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    with source, target.open("wb") as stream:
        copy = McapCopy(stream)
        damage = _copy_records(source, copy, about, advance)
        copy.writer.finish()
        stream.flush()
        os.fsync(stream.fileno())
    return [f"{path.name}: {damage}"] if damage else []


def _copy_records(source: IO[bytes], copy: McapCopy, about: About, advance: Advance) -> str:
    place = last = 0
    try:
        for record in read_data(source):
            if isinstance(record, Metadata) and record.name in (METADATA_RECORD, START_RECORD):
                about.update(read_record(record))
            else:
                last = max(last, copy.add(record))
            advance(source.tell() - place)
            place = source.tell()
    except (DatasetError, *DAMAGE) as error:
        why = "the file has no end" if isinstance(error, CUT_OFF) else error
        when = f"after the message of {1e-9 * last:.3f} s" if last else "before any message"
        return f"not read from byte {place:,} on, {when}: {why}"
    return _check_end(source)


def _check_end(stream: IO[bytes]) -> str:
    """Return what stands behind the end, as where files were joined; damage there is no loss."""
    with suppress(*DAMAGE):
        deque(StreamReader(stream, skip_magic=True).records, maxlen=0)
        if stream.read(1):
            return f"not read from byte {stream.tell() - 1:,} on: bytes follow its end"
    return ""
