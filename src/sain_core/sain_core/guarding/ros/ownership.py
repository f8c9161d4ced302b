"""One graph in each namespace of a ROS domain, by a lock; one publisher of each of its topics.

The system releases the lock when its process ends, killed or not.
"""

import os
from collections.abc import Iterable
from weakref import finalize

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_core.errors import BusyError
from sain_core.guarding.locks import LockedError, lock_file
from sain_core.guarding.untrusted import private_folder


def lock_namespace(node: Node) -> finalize:
    """Lock the namespace of a node that executes pushes; return what releases it when called.

    Raises `BusyError`, which names the process of this user that has locked it, or `OutputError`.
    """
    space, domain = node.get_namespace(), node.context.get_domain_id()
    path = private_folder() / lock_name(domain, space)
    try:
        return finalize(node, os.close, lock_file(path, node.get_fully_qualified_name()))
    except LockedError as error:
        holder = error.holder or "of another node"
        raise BusyError(
            f"process {holder} executes pushes in namespace {space} of domain {domain} already;"
            " stop it, or start this one with another ROS_DOMAIN_ID or namespace"
        ) from None


def lock_name(domain: int | str, namespace: str) -> str:
    """Return the name of the file that a graph in this domain and namespace locks."""
    return f"domain_{domain}{namespace.rstrip('/').replace('/', '.')}.lock"


def find_second_publisher(node: Node, topics: Iterable[str]) -> str:
    """Return the error of a topic with more than one publisher; "": there is none."""
    for topic in topics:
        name = node.resolve_topic_name(topic)
        if node.count_publishers(name) > 1 and len(found := publishers(node, name)) > 1:
            text = f"{' and '.join(found)} publish {name}; there must be one: stop the other"
            own = ", or give each graph a clock of its own with -r /clock:=clock"
            return text + (own if name == "/clock" else "")
    return ""


def publishers(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, sorted."""
    return sorted(map(full_name, node.get_publishers_info_by_topic(node.resolve_topic_name(topic))))


def full_name(publisher: TopicEndpointInfo) -> str:
    """Return namespace and name of a publisher's node."""
    if "_UNKNOWN_" in publisher.node_name + publisher.node_namespace:
        return "a node whose name is not known"  # it is not discovered yet
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
