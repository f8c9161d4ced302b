"""When a recorder hears all that is there.

Who subscribes sees a publisher, often seconds before that publisher sees who subscribes, where a
datagram of the discovery was lost. What is published in between is not heard, and nothing tells.
So each node is asked something. It can only answer a client that it has found, and the middleware
tells it of new readers in the order in which they were made: the subscriptions came before.
"""

import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.node import Node

from sain_bags.ros.recorder import Recorder
from sain_core import notify
from sain_core.errors import OutputError, SainError
from sain_core.storage import write_json
from sain_core.untrusted.json_text import read_json

SILENCE: Final = 5.0  # [s] after which nothing seems to be said
REST: Final = 0.5  # [s] from the first message until the other topics are known, too
PATIENCE: Final = 3.0  # [s] then, at most, until all have found it: some nodes never answer
NODES: Final = ".nodes.json"
NODES_PERIOD: Final = 0.5  # [s]
NOBODY: Final[frozenset[str]] = frozenset()
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


class Readiness:
    """Tells who supervises the recorder, once, that it hears all that is there."""

    def __init__(self, recorder: Recorder, started: float, before: frozenset[str] = NOBODY) -> None:
        """Wait from `started` [s] of `time.monotonic`, and for the nodes that were there before."""
        self._recorder = recorder
        self._due = started + SILENCE
        self._before = before
        self._known: tuple[int, frozenset[str]] = (0, NOBODY)
        self._handshake: Handshake | None = None
        self.told = False

    def work(self, written: int) -> None:
        """Look whether it is so; `written` is the number of messages of the last pass."""
        if self.told:
            return
        now = time.monotonic()
        if written:
            self._due = min(self._due, now + REST)
        if now < self._due:
            return
        known = (self._recorder.subscribed, self._recorder.owners())
        if self._handshake is None or self._known != known:  # what was made later is found later
            self.close()
            self._known, self._handshake = known, Handshake(self._recorder, known[1])
        self._handshake.work()
        found_all = self._handshake.is_complete and self._before <= known[1]
        if found_all or now >= self._due + PATIENCE:
            self.told = True
            self.close()
            notify.ready()

    def close(self) -> None:
        """Ask nobody any more."""
        if self._handshake is not None:
            self._handshake.close()


class NodesFile:
    """Names of the nodes that are recorded, for the process that goes on if this one is killed."""

    def __init__(self, folder: Path) -> None:
        """Read the names in the folder of a recording; there may be none."""
        self._path = folder / NODES
        self.before = NOBODY
        with suppress(SainError, OSError, TypeError):
            self.before = frozenset(map(str, read_json(self._path)))
        self._written = NOBODY
        self._next = 0.0

    def work(self, recorder: Recorder, found_all: bool) -> None:
        """Write the names, now and then, if there are others; add to them until all are found."""
        if (now := time.monotonic()) < self._next:
            return
        self._next = now + NODES_PERIOD
        names = recorder.owners() | (NOBODY if found_all else self.before)
        if names != self._written:
            self._written = names
            with suppress(OutputError):  # of the bag's own files it will be told
                write_json(self._path, sorted(names))

    def remove(self) -> None:
        """Leave nothing in a bag that is whole."""
        self._path.unlink(missing_ok=True)
