"""The types of the graph's messages, where a bag has them, and their fields that rows need."""

from collections.abc import Sequence
from typing import Final

from sain_bags.bag.layouts import MessageTypes
from sain_bags.reading.reader import Bag
from sain_core.errors import DatasetError
from sain_core.push import PUSH_NAMES
from sain_core.scene import STATE_NAMES
from sain_core.transitions import FRICTIONS

SCENE: Final = "sain_interfaces/msg/Scene"
GOAL: Final = "sain_interfaces/msg/Goal"
PLAN: Final = "sain_interfaces/msg/Plan"
PUSH_RESULT: Final = "sain_interfaces/msg/PushResult"
PREDICTION: Final = "sain_interfaces/msg/PushPrediction"
PUSH: Final = "sain_interfaces/msg/Push"
WORLD: Final = "sain_interfaces/msg/WorldParameters"
BODIES: Final = "sain_interfaces/msg/Bodies"
EPISODE_TYPES: Final = frozenset({SCENE, GOAL, PLAN, PUSH_RESULT, PREDICTION, BODIES})
DISKS: Final = "disks"
GOAL_ID: Final = "goal_id"

_IDS: Final = ("push_id", "episode_id")
_PUSH: Final = (*_IDS, "scene_id", *PUSH_NAMES)
_SCENE: Final = (
    "episode_id", "scene_id", "settled", "header.stamp.sec", "header.stamp.nanosec", DISKS,
)  # fmt: skip
FIELDS: Final = {
    PUSH: _PUSH,
    SCENE: _SCENE,
    PREDICTION: ("push_id", "error_code", "model", DISKS),
    GOAL: ("episode_id", "x", "y", "tolerance", GOAL_ID),
    WORLD: ("episode_id", *FRICTIONS),
    PUSH_RESULT: (
        *_IDS, "error_code", "error_message", "duration",
        *(f"push.{name}" for name in _PUSH),
        *(f"{scene}.{name}" for scene in ("before", "after") for name in _SCENE),
    ),
}  # fmt: skip
TEXTS: Final = frozenset({"model", "error_message"})


def all_paths(fields: Sequence[str]) -> list[str]:
    """Return the paths of fields, those of disks once for each number of a disk."""
    disks = [
        f"{name}.{column}" for name in fields if name.endswith(DISKS) for column in STATE_NAMES
    ]
    return [*(name for name in fields if not name.endswith(DISKS)), *disks]


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


def has_field(types: MessageTypes, name: str, path: str) -> bool:
    """Tell whether a message of this type has a field, also in a message within it."""
    kind = name
    for step in path.split("."):
        found = {entry.name: entry.type for entry in types.get(kind, ())}
        if step not in found:
            return False
        kind = found[step]
    return True


def namespaces(bag: Bag, *types: str) -> tuple[str, ...]:
    """Return the namespaces in which the bag has messages of some types, or else scenes."""
    wanted = types or (SCENE,)
    return tuple(sorted({parent_of(topic.name) for topic in bag.topics if topic.type in wanted}))


def parent_of(topic: str) -> str:
    """Return the namespace that a topic is in."""
    return topic.rpartition("/")[0]
