"""The content of ``metadata.yaml``, checked before anything relies on it."""

from collections.abc import Mapping
from typing import Any, Final

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import TOPICS, limit

TEXTS: Final = ("storage_identifier", "compression_mode", "compression_format", "ros_distro")
LARGEST: Final = (1 << 63) - 1  # count of messages


def check_metadata(content: Any) -> dict[str, Any]:
    """Return the metadata of a bag with what is empty in place of what is null.

    Raises:
        UntrustedFileError: a value is not of the kind that rosbag2 writes.
    """
    about = dict(_expect("the metadata", content, dict))
    for name in TEXTS:
        about[name] = _expect(name, _or(about.get(name), ""), str)
    about["files"] = _expect("files", _or(about.get("files"), []), list)
    paths = _expect("relative_file_paths", _or(about.get("relative_file_paths"), []), list)
    about["relative_file_paths"] = [_expect("a file's path", path, str) for path in paths]
    topics = _or(about.get("topics_with_message_count"), [])
    limit("topics", len(_expect("topics_with_message_count", topics, list)), TOPICS)
    about["topics_with_message_count"] = [_topic(topic) for topic in topics]
    custom_data = _expect("custom_data", _or(about.get("custom_data"), {}), dict)
    about["custom_data"] = {str(key): _text(key, value) for key, value in custom_data.items()}
    return about


def _topic(entry: Any) -> dict[str, Any]:
    topic = dict(_expect("topic_metadata", _expect("a topic", entry, dict)["topic_metadata"], dict))
    for name in ("name", "type"):
        topic[name] = _expect(f"{name} of a topic", topic[name], str)
    topic["type_description_hash"] = str(topic.get("type_description_hash") or "")
    count = _expect("message_count of a topic", _or(entry.get("message_count"), 0), int)
    if not 0 <= count <= LARGEST:
        raise UntrustedFileError(f"a topic has {count} messages")
    return {**entry, "topic_metadata": topic, "message_count": count}


def _or(value: Any, empty: Any) -> Any:
    return empty if value is None else value


def _text(key: Any, value: Any) -> str:
    if isinstance(value, Mapping | list):
        raise UntrustedFileError(f"custom_data has no text for {str(key)[:40]!r}")
    return str(_or(value, ""))


def _expect(name: str, value: Any, kind: type) -> Any:
    if not isinstance(value, kind):
        raise UntrustedFileError(f"{name} is {str(value)[:40]!r}; it must be a {kind.__name__}")
    return value
