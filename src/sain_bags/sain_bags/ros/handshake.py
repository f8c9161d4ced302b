"""Finds out which publishers' nodes have found the recorder's subscriptions.

Who subscribes sees a publisher, often seconds before that publisher sees who subscribes, where a
datagram of the discovery was lost. What is published in between is not heard, and nothing tells.
So each node is asked something. It can only answer a client that it has found, and the middleware
tells it of new readers in the order in which they were made: the subscriptions came before.
"""

import time
from collections.abc import Iterable
from typing import Any, Final

from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.node import Node

AGAIN: Final = 0.5  # [s], after which a node is asked again: it may have found the client too late


class Handshake:
    """Asks the nodes that are there for their parameters, none in particular."""

    def __init__(self, node: Node, owners: Iterable[str]) -> None:
        """Ask nodes by their full names. The subscriptions of `node` have been made."""
        self._node = node
        self._unanswered = {name: self._client(name) for name in set(owners)}
        self._next = 0.0

    @property
    def is_complete(self) -> bool:
        """Whether all have answered, as of the last `work`."""
        return not self._unanswered

    def work(self) -> None:
        """Take answers, and ask again who has not answered; nothing is waited for."""
        for name, client in list(self._unanswered.items()):
            with client.handle:
                answered = client.handle.take_response(GetParameters.Response)[0] is not None
            if answered:
                self._node.destroy_client(self._unanswered.pop(name))
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + AGAIN
            for client in filter(Client.service_is_ready, self._unanswered.values()):
                with client.handle:
                    client.handle.send_request(GetParameters.Request())

    def close(self) -> None:
        """Ask no more."""
        for client in self._unanswered.values():
            self._node.destroy_client(client)
        self._unanswered = {}

    def _client(self, owner: str) -> Any:
        return self._node.create_client(GetParameters, f"{owner}/get_parameters")
