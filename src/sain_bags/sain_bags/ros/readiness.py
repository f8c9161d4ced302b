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
from typing import Final

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node

from sain_bags.ros.recorder import Recorder
from sain_core.errors import OutputError, SainError
from sain_core.guarding import lifetime
from sain_core.guarding.documents import read_json
from sain_core.output import write_json

SILENCE: Final = 5.0  # [s] after which nothing seems to be said
REST: Final = 0.5  # [s] from the first message until the other topics are known, too
PATIENCE: Final = 3.0  # [s] then, at most, until all have found it: some nodes never answer
NODES: Final = ".nodes.json"
NODES_PERIOD: Final = 0.5  # [s]
NOBODY: Final[frozenset[str]] = frozenset()
AGAIN: Final = 0.5  # [s], after which a node is asked again: it may have found the client too late


class Question:
    """What one node is asked, as often as it takes, and how many answers have come."""

    def __init__(self, node: Node, owner: str) -> None:
        """Ask nothing yet."""
        self._node = node
        self._client = node.create_client(GetParameters, f"{owner}/get_parameters")
        self._asked = self._answers = 0

    @property
    def is_answered(self) -> bool:
        """Whether an answer has come."""
        return self._answers > 0

    @property
    def is_settled(self) -> bool:
        """Whether nobody is going to answer any more, as far as this node has seen."""
        return self._answers >= self._asked or not self._client.service_is_ready()

    def ask(self) -> None:
        """Ask, where somebody is there."""
        if self._client.service_is_ready():
            self._asked += 1
            with self._client.handle:
                self._client.handle.send_request(GetParameters.Request())

    def take(self) -> None:
        """Take the answers that have come."""
        with self._client.handle:
            while self._client.handle.take_response(GetParameters.Response)[0] is not None:
                self._answers += 1

    def close(self) -> None:
        """Take no more answers."""
        self._node.destroy_client(self._client)


class Handshake:
    """Asks the nodes that are there for their parameters, none in particular.

    A node that is still starting answers all that it was asked when it is done with that, and waits
    in vain for each client that is gone. So a client stays until all of its answers have come.
    """

    def __init__(self, node: Node) -> None:
        """Ask nobody yet."""
        self._node = node
        self._unanswered: dict[str, Question] = {}
        self._leaving: list[Question] = []
        self._next = 0.0

    def begin(self, owners: Iterable[str]) -> None:
        """Ask nodes by their full names, all anew. The subscriptions of `node` have been made."""
        self.end()
        self._unanswered = {name: Question(self._node, name) for name in set(owners)}
        self._next = 0.0

    @property
    def is_complete(self) -> bool:
        """Whether all have answered, as of the last `work`."""
        return not self._unanswered

    @property
    def is_waiting(self) -> bool:
        """Whether an answer is to come, wanted or not."""
        return bool(self._unanswered or self._leaving)

    def work(self) -> None:
        """Take answers, and ask again who has not answered; nothing is waited for."""
        for name, question in list(self._unanswered.items()):
            question.take()
            if question.is_answered:
                self._leaving.append(self._unanswered.pop(name))
        for question in list(self._leaving):
            question.take()
            if question.is_settled:
                question.close()
                self._leaving.remove(question)
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + AGAIN
            for question in self._unanswered.values():
                question.ask()

    def end(self) -> None:
        """Ask no more."""
        self._leaving += self._unanswered.values()
        self._unanswered = {}


class Readiness:
    """Tells who supervises the recorder, once, that it hears all that is there."""

    def __init__(self, recorder: Recorder, started: float, before: frozenset[str] = NOBODY) -> None:
        """Wait from `started` [s] of `time.monotonic`, and for the nodes that were there before."""
        self._recorder = recorder
        self._due = started + SILENCE
        self._before = before
        self._known: tuple[int, frozenset[str]] | None = None
        self._handshake = Handshake(recorder)
        self.told = False

    def work(self, written: int) -> None:
        """Look whether it is so; `written` is the number of messages of the last pass."""
        self._handshake.work()
        if self.told:
            return
        now = time.monotonic()
        if written:
            self._due = min(self._due, now + REST)
        if now < self._due:
            return
        known = (self._recorder.subscribed, self._recorder.owners())
        if self._known != known:  # what was made later is found later
            self._known = known
            self._handshake.begin(known[1])
        found_all = self._handshake.is_complete and self._before <= known[1]
        if found_all or now >= self._due + PATIENCE:
            self.told = True
            self._handshake.end()
            lifetime.ready()


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
