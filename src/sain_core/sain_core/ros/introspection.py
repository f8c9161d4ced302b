"""Service introspection: what is asked of a service and answered, on a topic of its own.

The topic is ``<service>/_service_event``; a recorder takes it like any other.
"""

from typing import Final

from rclpy.node import Node
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState

from sain_core.ros.qos import SERVICE

STATES: Final = {
    "disabled": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}


def introspect(node: Node, service: Service, level: str) -> None:
    """Publish each request and answer: disabled, when and by whom (metadata), or its contents."""
    if level != "disabled":
        service.configure_introspection(node.get_clock(), SERVICE, STATES[level])
