"""The topics that a recorder subscribes to, and the quality of service that it requests."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

from sain_bags.bag.metadata import TopicQos

DEPTH: Final = 2000  # messages a burst may hold before the recorder falls behind
IMAGES: Final = frozenset({"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"})
SERVICE_EVENT: Final = "/_service_event"  # ends the names of the topics of service introspection


@dataclass(frozen=True)
class Selection:
    """Which topics to record."""

    chosen: Collection[str] = ()  # full names; none: all
    hidden: bool = False  # also those that are hidden
    images: bool = False  # also images

    def wants(self, topic: str, types: Collection[str] = ()) -> bool:
        """Return whether to record a topic of these types.

        A chosen one, or any that is not hidden and no image, which a camera takes only while
        somebody subscribes; service calls are hidden and recorded too.
        """
        if self.chosen:
            return topic in self.chosen
        if not self.images and not IMAGES.isdisjoint(types):
            return False
        return self.hidden or topic.endswith(SERVICE_EVENT) or not is_hidden(topic)


def is_hidden(topic: str) -> bool:
    """Return whether a topic is hidden: a part of its name starts with an underscore."""
    return any(part.startswith("_") for part in topic.split("/"))


def adapt(offers: Sequence[TopicQos]) -> TopicQos:
    """Return the strongest request that every publisher of a topic can serve.

    A request stronger than an offer is not matched, and nothing would be received.
    """
    reliable = offers and all(qos.reliability == "reliable" for qos in offers)
    latched = offers and all(qos.durability == "transient_local" for qos in offers)
    return TopicQos(
        history="keep_last",
        depth=DEPTH,
        reliability="reliable" if reliable else "best_effort",
        durability="transient_local" if latched else "volatile",
    )
