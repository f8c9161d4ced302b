"""Is there another one already? Two owners of one topic would contradict each other."""

import time
from collections.abc import Iterable
from typing import Final

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_core.errors import BusyError

POLL_S: Final = 0.05
NAME_WAIT_S: Final = 2.0  # for the name of a node whose publisher was discovered before


def refuse_peers(node: Node, topics: Iterable[str], wait_s: float) -> None:
    """Look for other publishers of a node's own topics, before it publishes them itself.

    For so long, as peers take their time to be discovered.

    Raises:
        BusyError: naming topic and peer.
    """
    end = time.monotonic() + wait_s
    while True:
        for topic in topics:
            for peer in publishers(node, topic, NAME_WAIT_S):
                name = node.resolve_topic_name(topic)
                raise BusyError(f"{peer} publishes {name} already; {advice(name)}")
        if time.monotonic() >= end:
            return
        time.sleep(POLL_S)


def refuse_rivals(node: Node, topics: Iterable[str]) -> None:
    """Look whether a topic that one node should own has two publishers.

    Discovery takes its time on a busy machine: who found no peer at first may do so later.

    Raises:
        BusyError: naming topic and publishers.
    """
    for topic in topics:
        if len(owners := publishers(node, topic, NAME_WAIT_S)) > 1:
            name = node.resolve_topic_name(topic)
            raise BusyError(
                f"{' and '.join(owners)} publish {name}, so another graph is running already;"
                " stop it, or start this one with another ROS_DOMAIN_ID"
            )


def advice(name: str) -> str:
    """Return what helps where a topic has two owners."""
    if name == "/clock":
        return "stop it, or give each graph a namespace and its own clock with -r /clock:=clock"
    return "stop it, or start this one with another ROS_DOMAIN_ID"


def is_named(publisher: TopicEndpointInfo) -> bool:
    """Tell whether the node of a publisher is discovered, too."""
    return not (publisher.node_name + publisher.node_namespace).count("_UNKNOWN_")


def publishers(node: Node, topic: str, wait_s: float) -> list[str]:
    """Return the full names of the nodes that publish a topic; wait so long for unknown ones."""
    end = time.monotonic() + wait_s
    while True:
        found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if all(map(is_named, found)) or time.monotonic() >= end:
            return [full_name(one) for one in found]
        time.sleep(POLL_S)


def full_name(publisher: TopicEndpointInfo) -> str:
    """Return namespace and name of a publisher's node."""
    if not is_named(publisher):
        return "a node whose name is not known"
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
