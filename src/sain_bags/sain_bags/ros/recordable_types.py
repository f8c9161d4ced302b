"""What is known of the types of messages, of those that are installed and of others.

The node that publishes another type is asked for its definition. Every node of ROS 2 Jazzy and
later answers on ``<node>/get_type_description`` by default.
"""

import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from type_description_interfaces.srv import GetTypeDescription

from sain_bags.bag.definitions import Definitions, join
from sain_bags.ros.endpoints import message_class
from sain_bags.ros.type_support_stub import type_support_stub
from sain_core.errors import InvalidInputError

PATIENCE: Final = 4.0  # [s]
ONCE: Final = 0.5  # [s], for one answer
LOOK: Final = 0.02  # [s], between two looks for the publisher's node
UNKNOWN: Final = "_NODE_NAME_UNKNOWN_"  # of a node that rmw has not discovered yet
NAME: Final = "_recorder_type_client"  # hidden


@dataclass(frozen=True)
class RecordableType:
    """A type of messages."""

    name: str  # for example std_msgs/msg/Header
    hash: str  # RIHS01_..., empty where readers should not compare it
    message_class: type  # to subscribe with
    definition: "Future[str]"  # with those of all it refers to; empty: nobody knows it


class RecordableTypes:
    """Finds types where they are installed, and asks a publisher's node for those that are not."""

    def __init__(self, node: Node) -> None:
        """Ask for this node."""
        self._node = node
        self._definitions = Definitions()
        self._known: dict[tuple[str, str], RecordableType] = {}
        self._asker = ThreadPoolExecutor(1, "asker")  # messages do not wait for the answer

    def learn(self, name: str, topic: str, publisher: TopicEndpointInfo) -> RecordableType:
        """Return what is known of the type that a publisher of a topic sends.

        Raises:
            InvalidInputError: it is not installed, and cannot be recorded without.
        """
        key = (name, str(publisher.topic_type_hash))
        if key not in self._known:
            self._known[key] = self._find(name, topic, publisher)
        return self._known[key]

    def _find(self, name: str, topic: str, publisher: TopicEndpointInfo) -> RecordableType:
        type_hash = str(publisher.topic_type_hash)
        definition: Future[str] = Future()
        try:
            found = message_class(name)
            definition.set_result(self._definitions.joined(name))
        except InvalidInputError:
            found = type_support_stub(name, type_hash)
            definition = self._asker.submit(ask_definition, topic, publisher, self._node)
        # Readers take a service's types by other names than these, and find other hashes.
        return RecordableType(name, "" if "/srv/" in name else type_hash, found, definition)


def ask_definition(topic: str, publisher: TopicEndpointInfo, of: Node) -> str:
    """Return the definition of what a publisher sends, with those of all it refers to.

    It waits for the answer; empty: the publisher's node gave none.
    """
    context = of.context
    node = Node(NAME, context=context, start_parameter_services=False, enable_rosout=False)
    try:
        return _ask(node, topic, publisher)
    finally:
        node.destroy_node()


def _ask(node: Node, topic: str, publisher: TopicEndpointInfo) -> str:
    deadline = time.monotonic() + PATIENCE
    owner = _find_owner(node, topic, publisher, deadline)
    client = node.create_client(GetTypeDescription, f"{owner}/get_type_description")
    request = GetTypeDescription.Request(
        type_name=publisher.topic_type,
        type_hash=str(publisher.topic_type_hash),
        include_type_sources=True,
    )
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    client.wait_for_service(max(deadline - time.monotonic(), 0.0))
    while True:
        # An answer is lost where its sender has not found this client yet: ask again.
        answer, until = client.call_async(request), time.monotonic() + ONCE
        while not answer.done() and time.monotonic() < until:
            executor.spin_once(timeout_sec=0.1)
        if answer.done() or time.monotonic() > deadline:
            break
    executor.shutdown()
    return _joined(publisher.topic_type, answer.result()) if answer.done() else ""


def _find_owner(node: Node, topic: str, publisher: TopicEndpointInfo, deadline: float) -> str:
    """Return the full name of a publisher's node, which is discovered later than the publisher."""
    found = publisher
    while found.node_name == UNKNOWN and time.monotonic() < deadline:
        time.sleep(LOOK)
        for info in node.get_publishers_info_by_topic(topic):
            if info.endpoint_gid == publisher.endpoint_gid:
                found = info
    return f"{found.node_namespace.rstrip('/')}/{found.node_name}"


def _joined(type_name: str, answer: GetTypeDescription.Response) -> str:
    texts = {
        source.type_name: source.raw_file_contents
        for source in answer.type_sources
        if source.encoding == "msg"
    }
    try:
        return join(type_name, texts.__getitem__)
    except (InvalidInputError, KeyError):
        return ""
