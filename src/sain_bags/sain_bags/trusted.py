"""What a damaged bag still says about itself and can be believed, so that losses can be counted."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Final

import yaml
from mcap.records import Channel, Schema, Statistics
from mcap.stream_reader import StreamReader

from sain_bags.integrity import DAMAGE, check_summary
from sain_bags.metadata import METADATA_FILE
from sain_core.errors import DatasetError

DEFAULT_DISTRO: Final = "jazzy"


@dataclass(frozen=True)
class TrustedSummary:
    """The end of an MCAP file whose CRC is right."""

    schemas: Mapping[int, Schema]
    channels: Mapping[int, Channel]
    counts: Mapping[str, int]  # messages by topic
    extras: int  # attachments and metadata


def read_trusted_summary(stream: IO[bytes]) -> TrustedSummary | None:
    """Return a file's summary, None where there is none or no CRC says that it is undamaged."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    statistics = None
    try:
        footer = check_summary(stream)
        if not footer.summary_start or not footer.summary_crc:
            return None
        stream.seek(footer.summary_start)
        for record in StreamReader(stream, skip_magic=True).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Statistics):
                statistics = record
    except DAMAGE:
        return None
    if statistics is None or not set(statistics.channel_message_counts) <= set(channels):
        return None
    counts = {channel.topic: 0 for channel in channels.values()}
    for number, count in statistics.channel_message_counts.items():
        counts[channels[number].topic] += count
    extras = statistics.attachment_count + statistics.metadata_count
    return TrustedSummary(schemas, channels, counts, extras)


@dataclass(frozen=True)
class Sidecar:
    """What ``metadata.yaml`` says, as far as it can be read."""

    files: tuple[Path, ...]  # of the bag, in their order
    custom_data: Mapping[str, str] = field(default_factory=dict)
    ros_distro: str = DEFAULT_DISTRO
    counts: Mapping[str, int] | None = None  # messages by topic
    lost: str = ""  # what is lost for certain
    note: str = ""  # what is amiss but no loss


def read_sidecar(source: Path) -> Sidecar:
    """Find the MCAP files of a bag, and what stands beside them.

    Args:
        source: a bag's folder, or one MCAP file.

    Raises:
        DatasetError: there is no such file.
    """
    if source.is_file():
        return Sidecar((source,))
    files = tuple(sorted(source.glob("*.mcap"), key=lambda path: (len(path.name), path.name)))
    if not files:
        raise DatasetError(f"there is no MCAP file at {source}")
    if not (source / METADATA_FILE).is_file():
        return Sidecar(files, note=f"{METADATA_FILE} is missing: the recording was not closed")
    try:
        content = yaml.safe_load((source / METADATA_FILE).read_text(encoding="utf-8"))
        return _sidecar(files, source, content["rosbag2_bagfile_information"])
    except (OSError, ValueError, TypeError, KeyError, AttributeError, yaml.YAMLError):
        return Sidecar(files, lost=f"{METADATA_FILE} cannot be read: custom data is lost")


def _sidecar(files: tuple[Path, ...], source: Path, about: Mapping[str, Any]) -> Sidecar:
    counts: dict[str, int] = {}
    for topic in about["topics_with_message_count"]:
        name = topic["topic_metadata"]["name"]
        counts[name] = counts.get(name, 0) + int(topic["message_count"])
    missing = [str(n) for n in about["relative_file_paths"] if not (source / str(n)).is_file()]
    return Sidecar(
        files,
        {str(key): str(value) for key, value in dict(about.get("custom_data") or {}).items()},
        str(about.get("ros_distro") or DEFAULT_DISTRO),
        counts,
        f"{METADATA_FILE} names files that are not there: {', '.join(missing)}" if missing else "",
    )
