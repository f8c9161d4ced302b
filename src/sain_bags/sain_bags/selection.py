"""Which topics a recorder takes, and how it asks for them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sain_bags.metadata import OfferedQos


@dataclass(frozen=True)
class RequestedQos:
    """What a recorder asks of a topic's publishers."""

    reliable: bool
    transient_local: bool


def is_hidden(topic: str) -> bool:
    """Tell whether a topic is hidden: a part of its name starts with an underscore."""
    return any(part.startswith("_") for part in topic.split("/"))


def is_wanted(topic: str, chosen: Collection[str]) -> bool:
    """Tell whether to record a topic: one that was chosen, or any that is not hidden."""
    return topic in chosen if chosen else not is_hidden(topic)


def adapt(offers: Sequence[OfferedQos]) -> RequestedQos:
    """Return the strongest request that every publisher of a topic can serve.

    A request stronger than an offer is not matched, and nothing would be received.
    """
    return RequestedQos(
        reliable=bool(offers) and all(qos.reliability == "reliable" for qos in offers),
        transient_local=bool(offers) and all(qos.durability == "transient_local" for qos in offers),
    )
