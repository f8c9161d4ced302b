"""Hears from a process that it is ready and that it lives; see `sain_core.guarding.lifetime`."""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.config import Config, option
from sain_core.guarding import lifetime

CREDENTIALS: Final = struct.Struct("3i")  # process, user and group of who sent a datagram
LONGEST: Final = 200  # bytes of a datagram that are read


@dataclass(frozen=True)
class HeartbeatConfig(Config):
    """When a process counts as hung. `bond` has 4 s and 10 s: four heartbeats, as here."""

    timeout: float = option(
        1.0, "silence after which a process counts as hung", unit="s", minimum=0.1
    )
    connect_timeout: float = option(
        30.0, "time for a restarted process to get ready", unit="s", minimum=1.0
    )


class Heartbeats:
    """The heartbeats of one process, which gets `environment`."""

    def __init__(self, config: HeartbeatConfig) -> None:
        """Listen at an address of our own."""
        self._config = config
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self._socket.setblocking(False)
        self._socket.bind("")  # the kernel finds an abstract address that nobody has
        self._last = time.monotonic()
        self._suspected: dict[str, int] | None = None
        self.ready = False
        self.closing = ""  # what it does before it ends, when it is about to

    @property
    def environment(self) -> dict[str, str]:
        """What makes a process send heartbeats here."""
        address = self._socket.getsockname().decode("ascii").replace("\0", "@")
        return {lifetime.SOCKET: address, lifetime.TIMEOUT: str(round(1e6 * self._config.timeout))}

    @property
    def heard_at(self) -> float:
        """When the last heartbeat came [s], or when the process was started."""
        return self._last

    def hear(self, process_id: int) -> None:
        """Take what has come from a process."""
        for word, sender in self._datagrams():
            if sender != process_id:
                continue
            self._last, self._suspected = time.monotonic(), None
            self.ready = self.ready or word == lifetime.READY
            if word.startswith(lifetime.STOPPING):
                self.closing = word.removeprefix(lifetime.STOPPING).decode(errors="replace")

    def fault(self, process_id: int) -> str:
        """Return in words what is wrong with a process that runs; empty: nothing.

        A process that waits for a processor or a disk is late, and not hung.
        """
        silence, timeout = time.monotonic() - self._last, self._config.timeout
        if not self.ready or self.closing:
            limit = self._config.connect_timeout
            if self.closing:
                return f"was silent for {limit:g} s while {self.closing}" if silence > limit else ""
            return f"was not ready within {limit:g} s" if silence > limit else ""
        if silence < timeout / 2:
            return ""
        if self._suspected is None:
            self._suspected = waiting_times(process_id)
        if silence < timeout or silence - self._waited(process_id) < timeout:
            return ""
        return "" if waits_for_a_disk(process_id) else f"gave no sign of life for {silence:.1f} s"

    def close(self) -> None:
        """Hear nothing any more."""
        self._socket.close()

    def _waited(self, process_id: int) -> float:
        """Return how long a thread has waited for a processor since the first suspicion [s]."""
        before, now = self._suspected or {}, waiting_times(process_id)
        waits = [now[thread] - before[thread] for thread in now.keys() & before.keys()]
        return 1e-9 * max(waits, default=0)

    def _datagrams(self) -> Iterator[tuple[bytes, int]]:
        while True:
            try:
                word, about, _, _ = self._socket.recvmsg(
                    LONGEST, socket.CMSG_SPACE(CREDENTIALS.size)
                )
            except BlockingIOError:
                return
            for level, kind, data in about:
                if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS):
                    yield word, CREDENTIALS.unpack(data)[0]


def waiting_times(process_id: int) -> dict[str, int]:
    """Return how long each thread of a process has waited for a processor [ns]."""
    found = {}
    with suppress(OSError):
        for thread in Path(f"/proc/{process_id}/task").iterdir():
            with suppress(OSError):
                words = (thread / "schedstat").read_text().split()
                found[thread.name] = int(words[1])
    return found


def waits_for_a_disk(process_id: int) -> bool:
    """Tell whether the main thread of a process is in uninterruptible sleep."""
    with suppress(OSError):
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] == "D"
    return False
