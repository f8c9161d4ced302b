"""The graph's topics in a bag: their types, and the namespaces they are in."""

from collections.abc import Iterator, Sequence
from typing import Final

from sain_bags.bag.metadata import OWN_TYPES
from sain_bags.reading.reader import Bag, TopicSummary
from sain_core.errors import DatasetError

SCENE: Final = "sain_interfaces/msg/Scene"
GOAL: Final = "sain_interfaces/msg/Goal"
PLAN: Final = "sain_interfaces/msg/Plan"
PUSH_RESULT: Final = "sain_interfaces/msg/PushResult"
STROKE: Final = "sain_interfaces/msg/Stroke"
PUSH: Final = "sain_interfaces/msg/Push"
WORLD: Final = "sain_interfaces/msg/WorldParameters"
BODIES: Final = "sain_interfaces/msg/Bodies"


def namespaces(bag: Bag, *types: str) -> tuple[str, ...]:
    """Return the namespaces in which the bag has messages of some types, or else scenes."""
    wanted = types or (SCENE,)
    return tuple(sorted({parent_of(topic.name) for topic in bag.topics if topic.type in wanted}))


def choose_graph(bag: Bag, found: Sequence[str], wanted: str | None) -> str:
    """Return the namespace to read, of those that are in a bag; raises `DatasetError`."""
    if wanted is None and len(found) > 1:
        raise DatasetError(
            f"{bag.path} holds several graphs; choose one of {', '.join(found)} with --namespace"
        )
    if wanted is not None and wanted not in found:
        held = f"it has {', '.join(found)}" if found else "it has none"
        raise DatasetError(f"{bag.path} holds no graph {wanted!r}; {held}")
    return wanted if wanted is not None else next(iter(found), "")


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
