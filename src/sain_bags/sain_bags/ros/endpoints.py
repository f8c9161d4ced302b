"""Between rclpy's words for a topic's ends and those of a bag."""

import importlib

from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_bags.bag.metadata import TopicQos
from sain_core.errors import InvalidInputError


def message_class(type_name: str) -> type:
    """Return the Python class of a message type, also of a service's events."""
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


def offered_qos(info: TopicEndpointInfo) -> TopicQos:
    """Return what a publisher offers, in rosbag2's words."""
    qos = info.qos_profile
    return TopicQos(
        history=qos.history.name.lower(),
        depth=qos.depth,
        reliability=qos.reliability.name.lower(),
        durability=qos.durability.name.lower(),
        deadline=divmod(qos.deadline.nanoseconds, 10**9),
        lifespan=divmod(qos.lifespan.nanoseconds, 10**9),
        liveliness=qos.liveliness.name.lower(),
        liveliness_lease_duration=divmod(qos.liveliness_lease_duration.nanoseconds, 10**9),
    )


def qos_profile(qos: TopicQos) -> QoSProfile:
    """Return rclpy's words for a profile."""
    by_hand = qos.liveliness == "manual_by_topic"
    return QoSProfile(
        history=HistoryPolicy.get_from_short_key(qos.history),
        depth=qos.depth,
        reliability=ReliabilityPolicy.get_from_short_key(qos.reliability),
        durability=DurabilityPolicy.get_from_short_key(qos.durability),
        deadline=_duration(qos.deadline),
        lifespan=_duration(qos.lifespan),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if by_hand else LivelinessPolicy.AUTOMATIC,
        liveliness_lease_duration=_duration(qos.liveliness_lease_duration),
    )


def _duration(value: tuple[int, int]) -> Duration:
    return Duration(nanoseconds=min(value[0] * 10**9 + value[1], 2**63 - 1))
