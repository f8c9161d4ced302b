"""One owner for each topic on this computer, by locks; owners elsewhere, by what ROS discovers.

A lock file is named after the ROS domain and the topic with its namespace. The system releases it
when its owner ends, killed or not.
"""

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Final
from weakref import finalize

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_core.errors import BusyError
from sain_core.guarding.locks import POLL_S, LockedError, lock_file
from sain_core.guarding.untrusted import private_folder

NAME_WAIT_S: Final = 2.0  # for the name of a node whose publisher was discovered before


def refuse_peers(node: Node, topics: Iterable[str]) -> None:
    """Refuse to publish topics that somebody else publishes; raise `BusyError`, naming both."""
    for topic in topics:
        for peer in publishers(node, topic, NAME_WAIT_S):
            name = node.resolve_topic_name(topic)
            raise BusyError(f"{peer} publishes {name} already; {advice(name)}")


def refuse_rivals(node: Node, topics: Iterable[str]) -> None:
    """Raise `BusyError` where a topic that one node should own has two publishers.

    Discovery takes its time on a busy machine: who found no peer at first may do so later.
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
        endpoints = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if all(map(is_named, endpoints)) or time.monotonic() >= end:
            return [full_name(one) for one in endpoints]
        time.sleep(POLL_S)


def full_name(publisher: TopicEndpointInfo) -> str:
    """Return namespace and name of a publisher's node."""
    if not is_named(publisher):
        return "a node whose name is not known"
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"


PARTICIPANT: Final = 12  # bytes of an endpoint's id that its process has in common
EVENTS: Final = "/parameter_events"  # every node publishes them


class Ownership:
    """The locks of topics that only this node may publish."""

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Lock the topics; make it before their publishers.

        Raises:
            BusyError: another process of this user has one, named by its number.
            OutputError: the file of a lock cannot be written.
        """
        self._node = node
        self._names = [node.resolve_topic_name(topic) for topic in topics]
        self._process = _participant(node)
        self._reported = ""
        self._locks: list[finalize] = []
        try:
            for name in self._names:
                lock = _lock(name, node)
                self._locks.append(finalize(self, os.close, lock))
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Let another node have the topics."""
        for lock in self._locks:
            lock()

    def rival(self) -> str:
        """Return who else publishes an owned topic, and what to do; empty: nobody. Logs it, too."""
        named = ((name, full_name(one)) for name, one in self._strangers() if is_named(one))
        others = [f"{one} publishes {name}, too; {advice(name)}" for name, one in named]
        text = "; ".join(others[:1])
        if text and text != self._reported:
            self._node.get_logger().error(text)
        self._reported = text
        return text

    def _strangers(self) -> Iterator[tuple[str, TopicEndpointInfo]]:
        """Yield topic and publisher where the publisher is of another process."""
        for name in self._names:
            for one in self._node.get_publishers_info_by_topic(name):
                if bytes(one.endpoint_gid)[:PARTICIPANT] != self._process:
                    yield name, one


def _lock(topic: str, node: Node) -> int:
    """Return a descriptor of a file that is locked until it is closed."""
    domain, folder = node.context.get_domain_id(), private_folder()
    path = folder / f"domain_{domain}{topic.replace('/', '.')}.lock"
    try:
        return lock_file(path, node.get_fully_qualified_name())
    except LockedError as error:
        holder = error.holder or "of another node"
        raise BusyError(f"process {holder} publishes {topic} already; {advice(topic)}") from None


def _participant(node: Node) -> bytes:
    """Return what the endpoints of a node's process have in common: those of a new publisher."""

    def ids() -> set[bytes]:
        endpoints = node.get_publishers_info_by_topic(EVENTS)
        return {bytes(one.endpoint_gid)[: PARTICIPANT + 4] for one in endpoints}

    while True:
        before = ids()
        publisher = node.create_publisher(ParameterEvent, EVENTS, 1)
        made = ids() - before
        node.destroy_publisher(publisher)
        if len(made) == 1:  # else somebody was discovered in between
            return made.pop()[:PARTICIPANT]
