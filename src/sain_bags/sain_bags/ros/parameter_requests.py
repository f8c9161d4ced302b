"""Answers to ``ros2 param`` from nodes without an executor: it waits for each node's answer."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any, Final, cast

from rclpy.node import Node

PERIOD: Final = 0.1  # [s]


def serve_requests(node: Node) -> None:
    """Answer what was asked of the node's services; nothing is waited for."""
    for service in node.services:
        handle, kind = service.handle, cast(Any, service.srv_type)
        with handle:
            while (found := handle.service_take_request(kind.Request))[0] is not None:
                request, header = found
                service.send_response(service.callback(request, kind.Response()), header)


@contextmanager
def requests_served(node: Node) -> Iterator[None]:
    """Answer on a thread of its own, for as long as this lasts."""
    end = Event()

    def serve() -> None:
        while not end.wait(PERIOD):
            serve_requests(node)

    thread = Thread(target=serve, name="parameters", daemon=True)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()
