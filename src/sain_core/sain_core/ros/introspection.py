"""Service introspection: what is asked of a service and answered, on a topic of its own.

The topic is ``<service>/_service_event``; a recorder takes it like any other.
"""

from typing import Final

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState

EVENTS: Final = QoSProfile(depth=100)
STATES: Final = {
    "disabled": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}


def introspect(node: Node, service: Service, level: str) -> None:
    """Publish each request and answer: not at all, when and by whom, or with what is in them.

    Args:
        node: of the service.
        service: what is asked.
        level: disabled, metadata or contents.
    """
    if level != "disabled":
        service.configure_introspection(node.get_clock(), EVENTS, STATES[level])
