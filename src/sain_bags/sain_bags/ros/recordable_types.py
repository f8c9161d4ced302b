"""What is known of the types of messages, of those that are installed and of others."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_bags.bag.definitions import Definitions
from sain_bags.ros.endpoints import message_class
from sain_bags.ros.type_description_client import ask_definition
from sain_bags.ros.type_support_stub import type_support_stub
from sain_core.errors import InvalidInputError


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
