"""Copies what can be read of a damaged bag to a new one, and joins a recording's parts so.

A file is read up to its first damage: no message comes through that its chunk's CRC denies.
"""

import os
import struct
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, Final

from mcap.exceptions import EndOfFile
from mcap.records import Metadata
from mcap.stream_reader import StreamReader

from sain_bags.bag.metadata import (
    METADATA_RECORD,
    START_RECORD,
    Span,
    bag_metadata,
    find_parts,
    read_metadata,
    read_record,
    span_of,
    topic_of,
    write_metadata,
)
from sain_bags.bag.parts import check_parts, move_files, remove_parts
from sain_bags.mcap.copying import McapCopy
from sain_bags.mcap.integrity import DAMAGE, read_data
from sain_bags.mcap.mcap_file import McapFile
from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.untrusted import open_regular

CUT_OFF: Final = (EndOfFile, struct.error)  # before the record that ends the data

Advance = Callable[[int], object]  # called with the number of bytes that were read


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
            try:
                span = _describe(file, about, notes)
            except DatasetError as error:  # it names the copy, which is not there any more
                raise DatasetError(f"{source} is not recovered: {error.__cause__}") from error
            if span.messages:
                file.parent.rename(out)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot recover {source} to {out}: {reason}") from error
    return Recovered(span, losses)


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
    made = McapFile(file)
    counts = made.statistics.channel_message_counts
    topics = [
        (topic_of(channel, made.schemas.get(channel.schema_id)), counts.get(number, 0))
        for number, channel in made.channels.items()
    ]
    span, custom_data = span_of(made.statistics), {**(about.get("custom_data") or {}), **notes}
    distro = about.get("ros_distro") or "jazzy"
    write_metadata(file.parent, bag_metadata({file.name: span}, topics, custom_data, distro))
    return span


def _copy(
    files: tuple[Path, ...], target: Path, advance: Advance
) -> tuple[Mapping[str, Any], list[str]]:
    """Copy what can be read of files; return the metadata of the bag, and what was lost."""
    about: dict[str, Any] = {}
    losses = []
    with target.open("wb") as stream:
        copy = McapCopy(stream)
        for path in files:
            try:
                source = open_regular(path)
            except UntrustedFileError as error:
                raise DatasetError(f"{path} is not read: {error}") from error
            with source:
                if damage := _copy_file(source, copy, about, advance):
                    losses.append(f"{path.name}: {damage}")
        copy.writer.finish()
        stream.flush()
        os.fsync(stream.fileno())
    return about, losses


def _copy_file(source: IO[bytes], copy: McapCopy, about: dict[str, Any], advance: Advance) -> str:
    """Copy a file up to its first damage, add what it says of the bag to `about`.

    Returns:
        where and what the damage is; empty: none.
    """
    place = last = 0
    copy.begin_file()
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
