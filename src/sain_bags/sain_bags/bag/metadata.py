"""``metadata.yaml``, the file that makes a folder a rosbag2 bag: version 9 of its layout."""

import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from pathlib import Path, PurePath
from typing import Any, Final

from mcap.records import Channel, Metadata, Schema, Statistics
from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import parse_qos

from sain_bags.bag.parts import mcap_files
from sain_bags.mcap import integrity
from sain_bags.mcap.integrity import opened, rescue
from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.documents import dump_yaml, parse_yaml, read_yaml
from sain_core.guarding.kinds import BEGINNINGS, MCAP, SQLITE, describe
from sain_core.guarding.untrusted import TOPICS, limit

LAYOUT_VERSION: Final = 9
METADATA_FILE: Final = integrity.METADATA_FILE
METADATA_ROOT: Final = "rosbag2_bagfile_information"
METADATA_RECORD: Final = "rosbag2"  # by this name a file's record of the same content is found
START_RECORD: Final = "sain_bags"  # at the beginning of a file: what a crash leaves of it
OWN_TYPES: Final = "sain_interfaces/msg/"
STREAMS: Final = (f"{OWN_TYPES}Scene",)  # of these, they come at a rate
METADATA_KEY: Final = "serialized_metadata"
INFINITE: Final = (9_223_372_036, 854_775_807)  # [s, ns], rmw's duration without end
TEXTS: Final = ("storage_identifier", "compression_mode", "compression_format", "ros_distro")
LISTS: Final = ("files", "relative_file_paths", "topics_with_message_count")
KINDS: Final = {**dict.fromkeys(TEXTS, str), **dict.fromkeys(LISTS, list), "custom_data": dict}
LARGEST: Final = (1 << 63) - 1  # count of messages


def check_metadata(content: Any) -> dict[str, Any]:
    """Return the metadata of a bag with what is empty in place of what is null."""
    about = dict(_expect("the metadata", content, dict))
    about |= {name: _expect(name, about.get(name), kind) for name, kind in KINDS.items()}
    for path in about["relative_file_paths"]:
        _expect("a file's path", path, str)
    topics = about["topics_with_message_count"]
    limit("topics", len(topics), TOPICS)
    about["topics_with_message_count"] = [_checked_topic(topic) for topic in topics]
    for key, value in about["custom_data"].items():
        if isinstance(value, Mapping | list):
            raise UntrustedFileError(f"custom_data has no text for {str(key)[:40]!r}")
    texts = about["custom_data"].items()
    about["custom_data"] = {str(key): "" if value is None else str(value) for key, value in texts}
    return about


def _checked_topic(entry: Any) -> dict[str, Any]:
    topic = dict(_expect("topic_metadata", _expect("a topic", entry, dict)["topic_metadata"], dict))
    for name in ("name", "type"):
        topic[name] = _expect(f"{name} of a topic", topic[name], str)
    topic["type_description_hash"] = str(topic.get("type_description_hash") or "")
    count = _expect("message_count of a topic", entry.get("message_count"), int)
    if not 0 <= count <= LARGEST:
        raise UntrustedFileError(f"a topic has {count} messages")
    return {**entry, "topic_metadata": topic, "message_count": count}


def _expect(name: str, value: Any, kind: type) -> Any:
    if value is None:
        return kind()
    if not isinstance(value, kind):
        raise UntrustedFileError(f"{name} is {str(value)[:40]!r}; it must be a {kind.__name__}")
    return value


@dataclass(frozen=True)
class TopicQos:
    """The quality of service at one end of a topic, in rosbag2's terms."""

    history: str = "unknown"  # not known to peers through discovery
    depth: int = 0
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline: tuple[int, int] = INFINITE
    lifespan: tuple[int, int] = INFINITE
    liveliness: str = "automatic"
    liveliness_lease_duration: tuple[int, int] = INFINITE

    def as_record(self) -> dict[str, Any]:
        """Return the profile as rosbag2 writes it."""
        values = {
            name: {"sec": value[0], "nsec": value[1]} if isinstance(value, tuple) else value
            for name, value in vars(self).items()
        }
        return {**values, "avoid_ros_namespace_conventions": False}


@dataclass(frozen=True)
class Topic:
    """One recorded topic."""

    name: str
    type: str  # for example std_msgs/msg/Header
    definition: str  # of the type and all it refers to
    type_hash: str = ""  # RIHS01_..., empty when not known
    offered_qos: tuple[TopicQos, ...] = ()
    publishers: int = 1  # that it ever had

    @property
    def is_latched(self) -> bool:
        """Whether late subscribers receive the last message, however old it is."""
        return any(
            qos.durability == "transient_local" and qos.lifespan >= INFINITE
            for qos in self.offered_qos
        )

    @property
    def is_rare(self) -> bool:
        """Whether its messages state an event: data sets are read from these few.

        Scenes, joints, markers and clocks come at a rate, and are most of a recording.
        """
        return self.type.startswith(OWN_TYPES) and self.type not in STREAMS

    @property
    def about(self) -> dict[str, str]:
        """The metadata of its channel, as rosbag2 writes it."""
        profiles = dump_yaml([qos.as_record() for qos in self.offered_qos])
        return {"offered_qos_profiles": profiles, "topic_type_hash": self.type_hash}


@dataclass(frozen=True)
class Span:
    """When messages were received [ns since the epoch], and how many."""

    start: int = 0
    end: int = 0
    messages: int = 0

    def overlaps(self, other: "Span") -> bool:
        """Tell whether both have messages and the times of both meet, or one has none."""
        if not self.messages or not other.messages:
            return True
        return self.start <= other.end and other.start <= self.end


def bag_metadata(
    files: Mapping[str, Span],
    topics: Sequence[tuple[Topic, int]],
    custom_data: Mapping[str, str],
    ros_distro: str,
) -> dict[str, Any]:
    """Return the metadata of a bag, with rosbag2's keys; each topic with its count of messages."""
    span = whole_span(files.values())
    return {
        "version": LAYOUT_VERSION,
        "storage_identifier": "mcap",
        **_span(span),
        "topics_with_message_count": [_topic(topic, count) for topic, count in topics],
        "compression_format": "",  # of the layout; MCAP compresses its chunks by itself
        "compression_mode": "",
        "relative_file_paths": list(files),
        "files": [{"path": name, **_span(found)} for name, found in files.items()],
        "custom_data": dict(custom_data) or None,
        "ros_distro": ros_distro,
    }


def topic_of(channel: Channel, schema: Schema | None) -> Topic:
    """Return the topic that a channel of a file describes."""
    more = channel.metadata
    profiles = read_profiles(more.get("offered_qos_profiles", ""))
    kind = schema.name if schema else ""
    return Topic(channel.topic, kind, "", more.get("topic_type_hash", ""), profiles)


def span_of(file: Statistics) -> Span:
    """Return the span of a file's messages."""
    return Span(file.message_start_time, file.message_end_time, file.message_count)


def listed_counts(metadata: Mapping[str, Any]) -> Counter[tuple[str, str]]:
    """Return how many messages ``metadata.yaml`` lists, by topic and type."""
    counts: Counter[tuple[str, str]] = Counter()
    for entry in metadata.get("topics_with_message_count", ()):
        topic = entry["topic_metadata"]
        counts[topic["name"], topic["type"]] += entry["message_count"]
    return counts


def listed_spans(metadata: Mapping[str, Any]) -> dict[str, Span]:
    """Return the spans of files by their names, as far as ``metadata.yaml`` states them."""
    spans = {}
    for file in metadata.get("files", ()):
        with suppress(KeyError, TypeError, ValueError):
            start = int(file["starting_time"]["nanoseconds_since_epoch"])
            end = start + int(file["duration"]["nanoseconds"])
            name = PurePath(file["path"]).name
            spans[name] = Span(start, end, int(file["message_count"]))
    return spans


def whole_span(spans: Iterable[Span]) -> Span:
    """Return the span of all messages; parts without any do not count."""
    some = [span for span in spans if span.messages]
    if not some:
        return Span()
    start, end = min(span.start for span in some), max(span.end for span in some)
    return Span(start, end, sum(span.messages for span in some))


@lru_cache(maxsize=1024)
def read_profiles(text: str) -> tuple[TopicQos, ...]:
    """Return the profiles in a channel's metadata, of any version of the layout.

    There are none where they cannot be parsed.
    """
    try:
        return tuple(map(as_topic_qos, parse_qos(parse_yaml(text) or [])))
    except (OverflowError, TypeError, KeyError, ValueError, AttributeError):
        return ()


def as_topic_qos(qos: Qos) -> TopicQos:
    """Return a profile as rosbags has it in rosbag2's words."""
    words: dict[str, Any] = {
        name: value.name.lower() if isinstance(value, Enum) else value
        for name, value in qos._asdict().items()
        if name in TopicQos.__dataclass_fields__
    }
    for name in ("deadline", "lifespan", "liveliness_lease_duration"):
        words[name] = (int(words[name].sec), int(words[name].nsec))
    return TopicQos(**{**words, "depth": int(qos.depth)})


def metadata_record(metadata: Mapping[str, Any]) -> dict[str, str]:
    """Return the content of a file's record `METADATA_RECORD`, as rosbag2 writes it."""
    return {METADATA_KEY: dump_yaml(dict(metadata))}


def read_record(record: Metadata) -> dict[str, Any]:
    """Return the metadata of the bag in such a record; empty where it cannot be parsed."""
    try:
        return check_metadata(parse_yaml(record.metadata[METADATA_KEY]))
    except (KeyError, TypeError, ValueError):
        return {}


def write_metadata(folder: Path, metadata: Mapping[str, Any]) -> None:
    """Write ``metadata.yaml``, whole or not at all."""
    content = {METADATA_ROOT: dict(metadata)}
    part = folder / f".{METADATA_FILE}.part"
    part.write_text(dump_yaml(content), encoding="utf-8")
    part.replace(folder / METADATA_FILE)


def find_files(path: Path) -> tuple[dict[str, Any], tuple[Path, ...]]:
    """Return the content of a bag's ``metadata.yaml``, and its files; for a file, the file alone.

    Raises:
        DatasetError: it is no bag, or was not closed.
    """
    if not path.is_dir() and path.exists():
        return {"storage_identifier": storage_of(path)}, (path,)
    if not (path / METADATA_FILE).is_file():
        raise DatasetError(_why_no_bag(path))
    metadata = read_metadata(path)
    named = metadata["relative_file_paths"]
    # Up to version 3 of the layout the folder's name stood before the file's.
    files = tuple(path / PurePath(name).name for name in named)
    missing = [file.name for file in files if not file.is_file()]
    if not files or missing:
        what = f"; {missing[0]} is not there as a regular file" if missing else ""
        raise DatasetError(f"{path / METADATA_FILE} names the files {named}{what}")
    _refuse_others(path, files)
    return metadata, files


def find_parts(source: Path) -> tuple[Path, ...]:
    """Return the MCAP files of a bag, also of one that was not closed.

    Raises:
        DatasetError: there is no such file.
    """
    for path in (source, *sorted(source.glob("*.db3"))):
        if path.is_file() and storage_of(path) != "mcap":
            raise DatasetError(f"{path} is a sqlite3 file; `sqlite3 FILE .recover` saves those")
    if source.is_file():
        return (source,)
    if not (files := mcap_files(source)):
        what = f"; it {found}" if (found := describe(source)) else ""
        raise DatasetError(f"there is no MCAP file at {source}{what}")
    return files


def storage_of(file: Path) -> str:
    """Return the storage of a file that is named alone, or of a bag; damage may hide it."""
    what = describe(file)
    if what == BEGINNINGS[SQLITE]:
        return "sqlite3"
    with opened(file) as stream:
        begin, size = stream.read(len(MCAP)), stream.seek(0, 2)
        stream.seek(max(size - len(MCAP), 0))
        if MCAP in (begin, stream.read()):
            return "mcap"
    what = what or f"is no bag: it begins with {begin.hex(' ')}, an MCAP file with {MCAP.hex(' ')}"
    raise DatasetError(f"{file} {what}")


def reindex(bag: Path) -> str:
    """Return, as text, the command that makes another ``metadata.yaml``."""
    storage = "sqlite3" if any(bag.glob("*.db3")) else "mcap"
    command = shlex.join(["ros2", "bag", "reindex", "-s", storage, str(bag)])
    return f"`{command}` makes a new {METADATA_FILE} of what is there"


def _why_no_bag(path: Path) -> str:
    """Return why a path without ``metadata.yaml`` is no bag, and what to do."""
    if not path.is_dir():
        return f"no bag at {path.absolute()}"
    closed = f"{path} was not closed, or is still being recorded: it has no {METADATA_FILE}; "
    if mcap_files(path):
        return closed + rescue(path)
    if any(path.glob("*.db3")):
        return closed + reindex(path)
    what = describe(path)
    return f"{path} {what}" if what else f"{path} is no bag: it has no {METADATA_FILE}"


def _refuse_others(folder: Path, files: Sequence[Path]) -> None:
    """Refuse a bag that names a file twice, or not all that there are."""
    if len(set(files)) < len(files):
        raise DatasetError(f"{folder / METADATA_FILE} names a file twice; {reindex(folder)}")
    endings = {file.suffix for file in files}
    others = sorted(file.name for file in folder.iterdir() if file.suffix in endings)
    if others := [name for name in others if folder / name not in files]:
        raise DatasetError(
            f"{folder} holds {', '.join(others)}, which {METADATA_FILE} does not name;"
            f" {reindex(folder)}, or move it away"
        )


def describe_recording(folder: Path) -> str:
    """Return in a sentence what became of a recording, and what to do about it."""
    if not folder.exists():
        return "Nothing was recorded."
    try:
        find_files(folder)
    except DatasetError as error:
        return f"The recording is not whole: {error}."
    return "What was recorded is whole."


def read_metadata(folder: Path) -> dict[str, Any]:
    """Return the content of ``metadata.yaml``."""
    path = folder / METADATA_FILE
    try:
        content = read_yaml(path)
        return check_metadata((content if isinstance(content, dict) else {})[METADATA_ROOT])
    except (OSError, ValueError, KeyError) as error:
        reason = f"it lacks the key {error}" if isinstance(error, KeyError) else error
        raise DatasetError(f"{path} cannot be read ({reason}); {reindex(folder)}") from error


def _span(span: Span) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": span.end - span.start},
        "starting_time": {"nanoseconds_since_epoch": span.start},
        "message_count": span.messages,
    }


def _topic(topic: Topic, count: int) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type,
            "serialization_format": "cdr",
            "offered_qos_profiles": [qos.as_record() for qos in topic.offered_qos],
            "type_description_hash": topic.type_hash,
        },
        "message_count": count,
    }
