"""Requests from nodes the definitions of the types that they publish.

Every node of ROS 2 Jazzy and later answers on ``<node>/get_type_description`` by default.
"""

import time
from typing import Final

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from type_description_interfaces.srv import GetTypeDescription

from sain_bags.bag.definitions import join
from sain_core.errors import InvalidInputError

PATIENCE: Final = 4.0  # [s]
ONCE: Final = 0.5  # [s], for one answer
LOOK: Final = 0.02  # [s], between two looks for the publisher's node
UNKNOWN: Final = "_NODE_NAME_UNKNOWN_"  # of a node that rmw has not discovered yet
NAME: Final = "_recorder_type_client"  # hidden


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
