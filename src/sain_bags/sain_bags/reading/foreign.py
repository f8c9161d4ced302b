"""Bags that are no MCAP files, or that rosbag2 compressed: copied, for as long as they are read."""

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import apsw
import zstandard
from mcap.well_known import Profile
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import ReaderError
from ruamel.yaml.error import YAMLError

from sain_bags.bag.metadata import Topic, read_profiles
from sain_bags.mcap.integrity import Unpacking, unpack
from sain_bags.reading.bag_files import BagFiles
from sain_bags.reading.sqlite_file import StoredMessage, read_sqlite, whole_sqlite
from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import PIECE_BYTES, open_regular

UNCOMPRESSED: Final = ("", "none")
BAD_CONTENT: Final = (  # in rosbags
    apsw.Error, YAMLError, LookupError, TypeError, ValueError, AttributeError, RecursionError,
)  # fmt: skip
STORAGES: Final = ("mcap", "sqlite3")
WINDOW: Final = 1 << 20  # [bytes], unpacked at a time


def is_foreign(metadata: Mapping[str, Any]) -> bool:
    """Tell whether a bag is anything but MCAP files as they are."""
    return _storage(metadata) != "mcap" or _mode(metadata) not in UNCOMPRESSED


class CopiedBag:
    """A copy in MCAP, which is deleted with this."""

    def __init__(self, metadata: Mapping[str, Any], files: Sequence[Path]) -> None:
        """Copy a bag's messages.

        Raises:
            DatasetError: it cannot be read, or holds more than is allowed.
        """
        self._place = TemporaryDirectory(prefix="sain_bags-")
        try:
            self.files = _copy(metadata, files, Path(self._place.name))
        except BaseException:
            self._place.cleanup()
            raise


def _copy(metadata: Mapping[str, Any], files: Sequence[Path], place: Path) -> tuple[Path, ...]:
    storage, mode = _storage(metadata), _mode(metadata)
    if storage not in STORAGES:
        raise DatasetError(
            f"{files[0]} is of the storage {storage[:40]!r}; allowed: {', '.join(STORAGES)}"
        )
    if mode not in UNCOMPRESSED and metadata.get("compression_format") != "zstd":
        raise DatasetError(f"{files[0]} is compressed; only zstd can be read")
    unpacked = tuple(_unpack(file, place) if mode == "file" else file for file in files)
    if storage == "mcap" and mode != "message":
        return unpacked
    copies = tuple(place / f"copy_{number}.mcap" for number in range(len(files)))
    read = _read_sqlite if storage == "sqlite3" else _read_mcap
    for file, source, copy in zip(unpacked, files, copies, strict=True):
        with copy.open("wb") as stream:
            _write(McapWriter(stream), read(file, source, place), mode == "message", source)
    return copies


def _write(
    writer: McapWriter, found: Iterator[Topic | StoredMessage], is_packed: bool, source: Path
) -> None:
    unpacking = Unpacking(source.stat().st_size)
    channels: dict[tuple[str, str], int] = {}
    writer.start(profile=Profile.ROS2)
    for one in found:
        if isinstance(one, Topic):
            schema = writer.register_schema(one.type, "ros2msg", one.definition.encode())
            about = {"offered_qos_profiles": one.qos_text(), "topic_type_hash": one.type_hash}
            channels[one.name, one.type] = writer.register_channel(one.name, "cdr", schema, about)
        else:
            data = _unpack_message(one.data, unpacking, source) if is_packed else one.data
            writer.add_message(channels[one.topic], one.time, data, one.time)
    writer.finish()


def _read_sqlite(file: Path, source: Path, place: Path) -> Iterator[Topic | StoredMessage]:
    try:
        yield from read_sqlite(whole_sqlite(file, place))
    except (sqlite3.Error, ReaderError, *BAD_CONTENT, UntrustedFileError) as error:
        reason = " ".join(str(error).split())
        raise DatasetError(f"{source} cannot be read: {reason}; get the bag again") from error


def _read_mcap(file: Path, *_: Path) -> Iterator[Topic | StoredMessage]:
    bag = BagFiles([file])
    for found in bag.channels:
        schema, about = found.schema, found.channel.metadata
        is_described = schema is not None and schema.encoding == "ros2msg"
        yield Topic(
            found.topic,
            found.type,
            found.definition() if is_described else "",
            about.get("topic_type_hash", ""),
            read_profiles(about.get("offered_qos_profiles", "")),
        )
    for batch in bag.batches():
        columns = (batch.channels, batch.starts, batch.starts + batch.sizes, batch.log_times)
        for number, start, end, time in zip(*(c.tolist() for c in columns), strict=True):
            data = batch.data[start:end].tobytes()
            yield StoredMessage((bag.channels[number].topic, bag.channels[number].type), time, data)


def _unpack(source: Path, place: Path) -> Path:
    """Return a file, unpacked; raises `DatasetError`."""
    target = place / source.stem
    try:
        with open_regular(source) as packed, target.open("wb") as file:
            unpacking = Unpacking(source.stat().st_size)
            reader = zstandard.ZstdDecompressor(max_window_size=PIECE_BYTES).stream_reader(packed)
            while part := reader.read(WINDOW):
                unpacking.take(len(part))
                file.write(part)
    except (OSError, UntrustedFileError, zstandard.ZstdError) as error:
        raise DatasetError(f"{source} cannot be unpacked: {error}") from error
    return target


def _unpack_message(data: bytes, unpacking: Unpacking, source: Path) -> bytes:
    try:
        found = bytes(unpack(b"zstd", data, PIECE_BYTES))
        unpacking.take(len(found))
    except (DatasetError, MemoryError, zstandard.ZstdError) as error:
        raise DatasetError(f"a message in {source} cannot be unpacked: {error}") from error
    return found


def _storage(metadata: Mapping[str, Any]) -> str:
    return str(metadata.get("storage_identifier") or "mcap")


def _mode(metadata: Mapping[str, Any]) -> str:
    return str(metadata.get("compression_mode") or "").lower()
