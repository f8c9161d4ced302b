"""Answers to ``ros2 param`` from a node without an executor."""

from typing import Any, cast

from rclpy.node import Node


def serve_requests(node: Node) -> None:
    """Answer what was asked of the node's services; nothing is waited for.

    ``ros2 param list`` waits for each node's answer.
    """
    for service in node.services:
        handle, kind = service.handle, cast(Any, service.srv_type)
        with handle:
            while (found := handle.service_take_request(kind.Request))[0] is not None:
                request, header = found
                service.send_response(service.callback(request, kind.Response()), header)
