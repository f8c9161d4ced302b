"""One owner for each topic: of two nodes that claim one, the later ends.

A claim is a publisher on a hidden topic below the owned one; it never sends anything. Its name has
the time of the claim, so all nodes that discover it agree which came first, however late they do.
"""

import os
import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, NoReturn
from zlib import crc32

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import Empty

from sain_core.errors import BusyError
from sain_core.ros.peers import NAME_WAIT_S, POLL_S, advice, full_name, is_named, publishers
from sain_core.ros.qos import LATCHED

MARK: Final = "_owner"
CLAIM: Final = re.compile(rf"(.+)/{MARK}/at_(\d+)_(\d+)_(\d+)")
ENDED: Final = ("Z", "X")  # states of a process that nobody has waited for
PARTICIPANT: Final = 12  # bytes of an endpoint's id that its process has in common


@dataclass(frozen=True, order=True)
class Claim:
    """When a process claimed a topic; the earliest counts."""

    since: int  # [ns]
    process: int
    system: int  # where the process has this number

    @classmethod
    def now(cls) -> "Claim":
        """Return a claim of this process."""
        return cls(time.time_ns(), os.getpid(), _system())

    def topic(self, name: str) -> str:
        """Return the hidden topic that claims a topic."""
        return f"{name}/{MARK}/at_{self.since}_{self.process}_{self.system}"

    @property
    def holds(self) -> bool:
        """Whether its process may still be there: a killed one is discovered for a while."""
        return self.system != _system() or _is_running(self.process)


def _is_running(process: int) -> bool:
    try:
        status = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] not in ENDED


@cache
def _system() -> int:
    """Return a number for the kernel and the container that process numbers belong to."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text()
        return crc32(f"{boot} {Path('/proc/self/ns/pid').readlink()}".encode())
    except OSError:
        return 0


class Ownership:
    """The claim of a node to topics that nobody else may publish."""

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Claim the topics; make it before their publishers."""
        self._node = node
        self._names = [node.resolve_topic_name(topic) for topic in topics]
        self._claim = Claim.now()
        self._claims_made = [
            node.create_publisher(Empty, self._claim.topic(name), LATCHED) for name in self._names
        ]
        self._reported = ""

    def refuse(self, wait_s: float, strangers: bool = True) -> None:
        """Look for an earlier claim, for so long [s]: discovery takes its time.

        Also for publishers without a claim, such as a player of recordings, unless not `strangers`.

        Raises:
            BusyError: naming topic and node.
        """
        end = time.monotonic() + wait_s
        while True:
            self._refuse_earlier()
            found = list(self._strangers()) if strangers else []
            for name, one in found:
                if is_named(one) or time.monotonic() >= end + NAME_WAIT_S:
                    self._give_up(name, full_name(one))
            if time.monotonic() >= end and not found:
                return
            time.sleep(POLL_S)

    def rival(self) -> str:
        """Return who else publishes an owned topic, with what to do; empty: nobody. Logs it, too.

        Raises:
            BusyError: somebody has claimed a topic earlier, so this node must end.
        """
        self._refuse_earlier()
        found = [f"{one} publishes {name}, too; {advice(name)}" for name, one in self._others()]
        text = "; ".join(found[:1])
        if text and text != self._reported:
            self._node.get_logger().error(text)
        self._reported = text
        return text

    def _refuse_earlier(self) -> None:
        for name, claim in self._claims():
            if claim < self._claim and claim.holds:
                self._give_up(name, self._name_of(claim.topic(name)))

    def _give_up(self, name: str, owner: str) -> NoReturn:
        while self._claims_made:
            self._node.destroy_publisher(self._claims_made.pop())
        raise BusyError(f"{owner} publishes {name} already; {advice(name)}")

    def _others(self) -> Iterator[tuple[str, str]]:
        for name, claim in self._claims():
            if claim != self._claim and claim.holds:
                yield name, self._name_of(claim.topic(name))
        yield from ((name, full_name(one)) for name, one in self._strangers() if is_named(one))

    def _claims(self) -> list[tuple[str, Claim]]:
        """Return the claims to each topic, in the order of the topics."""
        topics = [topic for topic, _ in self._node.get_topic_names_and_types()]
        matches = [found for topic in topics if (found := CLAIM.fullmatch(topic))]
        return [
            (name, Claim(*map(int, found.groups()[1:])))
            for name in self._names
            for found in matches
            if found[1] == name
        ]

    def _strangers(self) -> Iterator[tuple[str, TopicEndpointInfo]]:
        """Yield topic and publisher where the publisher's process has no claim to the topic."""
        claimed = set()
        for name, claim in self._claims():
            for one in self._node.get_publishers_info_by_topic(claim.topic(name)):
                claimed.add((name, bytes(one.endpoint_gid)[:PARTICIPANT]))
        for name in self._names:
            for one in self._node.get_publishers_info_by_topic(name):
                if (name, bytes(one.endpoint_gid)[:PARTICIPANT]) not in claimed:
                    yield name, one

    def _name_of(self, topic: str) -> str:
        return next(iter(publishers(self._node, topic, NAME_WAIT_S)), "another process")
