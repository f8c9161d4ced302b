"""The topics that a recorder subscribes to, and the quality of service that it requests."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

from sain_bags.bag.metadata import OfferedQos

SERVICE_EVENT: Final = "/_service_event"  # ends the names of the topics of service introspection


@dataclass(frozen=True)
class RequestedQos:
    """The quality of service that a recorder requests."""

    reliable: bool
    transient_local: bool


@dataclass(frozen=True)
class Selection:
    """Which topics to record."""

    chosen: Collection[str] = ()  # full names; none: all
    hidden: bool = False  # also those that are hidden

    def wants(self, topic: str) -> bool:
        """Return whether to record a topic.

        A chosen one, or any that is not hidden; service calls are hidden and recorded too.
        """
        if self.chosen:
            return topic in self.chosen
        return self.hidden or topic.endswith(SERVICE_EVENT) or not is_hidden(topic)


def is_hidden(topic: str) -> bool:
    """Return whether a topic is hidden: a part of its name starts with an underscore."""
    return any(part.startswith("_") for part in topic.split("/"))


def adapt(offers: Sequence[OfferedQos]) -> RequestedQos:
    """Return the strongest request that every publisher of a topic can serve.

    A request stronger than an offer is not matched, and nothing would be received.
    """
    return RequestedQos(
        reliable=bool(offers) and all(qos.reliability == "reliable" for qos in offers),
        transient_local=bool(offers) and all(qos.durability == "transient_local" for qos in offers),
    )
