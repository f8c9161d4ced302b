"""The types of the graph's messages, where a bag has them, and their fields that rows need."""

from collections.abc import Iterator, Sequence
from typing import Final

from sain_bags.bag.layouts import MessageTypes
from sain_bags.bag.metadata import OWN_TYPES
from sain_bags.reading.reader import Bag, TopicSummary
from sain_core.errors import DatasetError
from sain_core.push import PUSH_NAMES
from sain_core.scene import STATE_NAMES

SCENE: Final = "sain_interfaces/msg/Scene"
GOAL: Final = "sain_interfaces/msg/Goal"
PLAN: Final = "sain_interfaces/msg/Plan"
PUSH_RESULT: Final = "sain_interfaces/msg/PushResult"
PUSH: Final = "sain_interfaces/msg/Push"
WORLD: Final = "sain_interfaces/msg/WorldParameters"
BODIES: Final = "sain_interfaces/msg/Bodies"
DISKS: Final = "disks"
COUNT: Final = "[]"  # ends the path of a sequence of messages of which only the length is needed
PREDICTION: Final = "prediction"

_SCENE: Final = (
    "episode_id", "scene_id", "settled", "header.stamp.sec", "header.stamp.nanosec",
    "header.frame_id", DISKS,
)  # fmt: skip
FIELDS: Final = (  # of a `PushResult`
    "push_id", "episode_id", "error_code", "error_message", "duration", "wall_time",
    *(f"push.{name}" for name in ("push_id", "episode_id", "source", *PUSH_NAMES)),
    *(f"{scene}.{name}" for scene in ("before", "after") for name in _SCENE),
    *(f"{PREDICTION}.{name}" for name in ("model", "error_code", DISKS)),
)  # fmt: skip
TEXTS: Final = frozenset(
    {"error_message", "push.source", f"{PREDICTION}.model"}
    | {f"{scene}.header.frame_id" for scene in ("before", "after")}
)


def all_paths(fields: Sequence[str]) -> list[str]:
    """Return the paths of fields, those of disks once for each number of a disk."""
    disks = [
        f"{name}.{column}" for name in fields if name.endswith(DISKS) for column in STATE_NAMES
    ]
    return [*(name for name in fields if not name.endswith((DISKS, COUNT))), *disks]


def check_path(types: MessageTypes, name: str, path: str) -> None:
    """Raise `DatasetError` unless a message has a field of the needed type."""
    kind = name
    for step in path.split("."):
        found = {entry.name: entry.type for entry in types.get(kind, ())}
        if step not in found:
            raise DatasetError(f"{name} has no {path}")
        kind = found[step]
    is_text = kind == "string"
    if kind in types or is_text != (path in TEXTS):
        raise DatasetError(f"{path} of {name} is a {kind}")


def namespaces(bag: Bag, *types: str) -> tuple[str, ...]:
    """Return the namespaces in which the bag has messages of some types, or else scenes."""
    wanted = types or (SCENE,)
    return tuple(sorted({parent_of(topic.name) for topic in bag.topics if topic.type in wanted}))


def topics_of(bag: Bag, namespace: str, *types: str) -> tuple[str, ...]:
    """Return the topics of one graph that have some types."""
    return tuple(
        topic.name
        for topic in bag.topics
        if topic.type in types and parent_of(topic.name) == namespace
    )


def left_out(bag: Bag) -> Iterator[str]:
    """Yield which messages are not read, as another type came on a topic of the graph."""
    types: dict[str, list[TopicSummary]] = {}
    for topic in bag.topics:
        types.setdefault(topic.name, []).append(topic)
    for name, found in types.items():
        wanted = [topic.type for topic in found if topic.type.startswith(OWN_TYPES)]
        for topic in found if wanted else ():
            if topic.messages and topic.type not in wanted:
                yield (
                    f"{name} has {topic.messages:,} messages of another type, {topic.type}; they"
                    f" are left out: it is read as {' and '.join(wanted)}"
                )


def parent_of(topic: str) -> str:
    """Return the namespace that a topic is in."""
    return topic.rpartition("/")[0]
