"""Between rclpy's words for a topic's ends and those of a bag."""

import importlib
from typing import Final

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_bags.bag.metadata import OfferedQos
from sain_bags.writing.selection import RequestedQos
from sain_core.errors import InvalidInputError

DEPTH: Final = 2000  # messages a burst may hold before the recorder falls behind


def message_class(type_name: str) -> type:
    """Return the Python class of a message type, also of a service's events.

    Raises:
        InvalidInputError: its package is not installed, or has no such message.
    """
    package, kind, name = type_name.split("/")
    try:
        module = importlib.import_module(f"{package}.{kind}")
        if kind == "srv":
            found: type = getattr(module, name.removesuffix("_Event")).Event
        else:
            found = getattr(module, name)
    except (ImportError, AttributeError) as error:
        raise InvalidInputError(f"{type_name} is not installed ({error})") from error
    return found


def offered_qos(info: TopicEndpointInfo) -> OfferedQos:
    """Return what a publisher offers, in rosbag2's words."""
    qos = info.qos_profile
    return OfferedQos(
        history=qos.history.name.lower(),
        depth=qos.depth,
        reliability=qos.reliability.name.lower(),
        durability=qos.durability.name.lower(),
        deadline=divmod(qos.deadline.nanoseconds, 10**9),
        lifespan=divmod(qos.lifespan.nanoseconds, 10**9),
        liveliness=qos.liveliness.name.lower(),
        liveliness_lease_duration=divmod(qos.liveliness_lease_duration.nanoseconds, 10**9),
    )


def request_profile(wanted: RequestedQos) -> QoSProfile:
    """Return the profile to subscribe with."""
    return QoSProfile(
        depth=DEPTH,
        reliability=(
            ReliabilityPolicy.RELIABLE if wanted.reliable else ReliabilityPolicy.BEST_EFFORT
        ),
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL
            if wanted.transient_local
            else DurabilityPolicy.VOLATILE
        ),
    )
