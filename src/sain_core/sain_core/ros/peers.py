"""Is there another one already? Two owners of one topic would contradict each other."""

import time
from collections.abc import Iterable
from typing import Final

from rclpy.node import Node

from sain_core.errors import BusyError

POLL_S: Final = 0.05


def refuse_peers(node: Node, topics: Iterable[str], wait_s: float) -> None:
    """Look for other publishers of a node's own topics, before it publishes them itself.

    For so long, as peers take their time to be discovered.

    Raises:
        BusyError: naming topic and peer.
    """
    end = time.monotonic() + wait_s
    while True:
        for topic in topics:
            for peer in _publishers(node, topic):
                raise BusyError(
                    f"{peer} publishes {node.resolve_topic_name(topic)} already;"
                    " stop it, or start this one with another ROS_DOMAIN_ID"
                )
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
        if len(owners := _publishers(node, topic)) > 1:
            name = node.resolve_topic_name(topic)
            raise BusyError(
                f"{' and '.join(owners)} publish {name}, so another graph is running already;"
                " stop it, or start this one with another ROS_DOMAIN_ID"
            )


def publisher_count(node: Node, topic: str) -> int:
    """Return how many publishers a topic has, the node itself included."""
    return len(_publishers(node, topic))


def _publishers(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic."""
    found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return [f"{one.node_namespace.rstrip('/')}/{one.node_name}" for one in found]
