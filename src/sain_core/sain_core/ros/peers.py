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
    names = [node.resolve_topic_name(topic) for topic in topics]
    end = time.monotonic() + wait_s
    while True:
        for name in names:
            for peer in node.get_publishers_info_by_topic(name):
                raise BusyError(
                    f"{peer.node_namespace.rstrip('/')}/{peer.node_name} publishes {name} already;"
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
    for name in (node.resolve_topic_name(topic) for topic in topics):
        owners = [
            f"{owner.node_namespace.rstrip('/')}/{owner.node_name}"
            for owner in node.get_publishers_info_by_topic(name)
        ]
        if len(owners) > 1:
            raise BusyError(
                f"{' and '.join(owners)} publish {name}, so another graph is running already;"
                " stop it, or start this one with another ROS_DOMAIN_ID"
            )


def publisher_count(node: Node, topic: str) -> int:
    """Return how many publishers a topic has, the node itself included."""
    return len(node.get_publishers_info_by_topic(node.resolve_topic_name(topic)))
