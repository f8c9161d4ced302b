"""One owner for each topic: on this computer the process that holds its lock.

The lock of a file ends with its process, however that ends, and depends on no clock, no name and no
discovery. Publishers elsewhere hold none: they are refused at the start, and reported later.
"""

import fcntl
import os
import time
from collections.abc import Iterator, Sequence
from errno import EEXIST
from pathlib import Path
from stat import S_ISREG
from typing import Final
from weakref import finalize

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sain_core.errors import BusyError, OutputError
from sain_core.ros.peers import NAME_WAIT_S, POLL_S, advice, full_name, is_named
from sain_core.workers.scratch import private_folder

PARTICIPANT: Final = 12  # bytes of an endpoint's id that its process has in common
ENDING_S: Final = 1.0  # the longest that the end of a process takes that was killed
EVENTS: Final = "/parameter_events"  # every node publishes them


class Ownership:
    """The locks of topics that only this node may publish."""

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Lock the topics; make it before their publishers.

        Raises:
            BusyError: another process of this user has one, named by its number.
            OutputError: the file of a lock cannot be written.
        """
        self._node = node
        self._names = [node.resolve_topic_name(topic) for topic in topics]
        self._process = _participant(node)
        self._reported = ""
        self._locks: list[finalize] = []
        try:
            for name in self._names:
                lock = _lock(name, node.context.get_domain_id())
                self._locks.append(finalize(self, os.close, lock))
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Let another node have the topics."""
        for lock in self._locks:
            lock()

    def refuse(self, wait_s: float) -> None:
        """Look for publishers without a lock, for so long [s]: discovery takes its time.

        Raises:
            BusyError: naming topic and node.
        """
        end = time.monotonic() + wait_s
        while True:
            found = list(self._strangers())
            for name, one in found:
                if is_named(one) or time.monotonic() >= end + NAME_WAIT_S:
                    self.release()
                    raise BusyError(f"{full_name(one)} publishes {name} already; {advice(name)}")
            if time.monotonic() >= end and not found:
                return
            time.sleep(POLL_S)

    def rival(self) -> str:
        """Return who else publishes an owned topic, and what to do; empty: nobody. Logs it, too."""
        named = ((name, full_name(one)) for name, one in self._strangers() if is_named(one))
        found = [f"{one} publishes {name}, too; {advice(name)}" for name, one in named]
        text = "; ".join(found[:1])
        if text and text != self._reported:
            self._node.get_logger().error(text)
        self._reported = text
        return text

    def _strangers(self) -> Iterator[tuple[str, TopicEndpointInfo]]:
        """Yield topic and publisher where the publisher is of another process."""
        for name in self._names:
            for one in self._node.get_publishers_info_by_topic(name):
                if bytes(one.endpoint_gid)[:PARTICIPANT] != self._process:
                    yield name, one


def _lock(topic: str, domain: int) -> int:
    """Return a descriptor of a file that is locked until it is closed."""
    path = private_folder() / f"domain_{domain}{topic.replace('/', '.')}.lock"
    try:
        descriptor = _open(path)
        end = time.monotonic() + ENDING_S
        while not _is_locked(descriptor):
            if time.monotonic() >= end:
                holder = os.pread(descriptor, 100, 0).decode(errors="replace").strip()
                os.close(descriptor)
                raise BusyError(
                    f"process {holder or 'of another node'} publishes {topic} already;"
                    f" {advice(topic)}"
                )
            time.sleep(POLL_S)
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
    except OSError as error:
        raise OutputError(f"cannot lock {path}: {error.strerror}") from error
    return descriptor


def _open(path: Path) -> int:
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o600)
    if not S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise FileExistsError(EEXIST, "it is no regular file; remove it")
    return descriptor


def _is_locked(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _participant(node: Node) -> bytes:
    """Return what the endpoints of a node's process have in common: those of a new publisher."""

    def known() -> set[bytes]:
        found = node.get_publishers_info_by_topic(EVENTS)
        return {bytes(one.endpoint_gid)[: PARTICIPANT + 4] for one in found}

    while True:
        before = known()
        publisher = node.create_publisher(ParameterEvent, EVENTS, 1)
        made = known() - before
        node.destroy_publisher(publisher)
        if len(made) == 1:  # else somebody was discovered in between
            return made.pop()[:PARTICIPANT]
