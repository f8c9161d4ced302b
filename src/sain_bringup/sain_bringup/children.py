"""One process of a graph: how it is started, that it is ready and lives, and how it ended.

For its heartbeats see `sain_core.guarding.lifetime`.
"""

import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from sain_core.config import Config, option
from sain_core.errors import INTERRUPTED, OutputError, SainError
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

    def heard_at(self, process_id: int) -> float:
        """Return when the last heartbeat came [s], or when the process was started.

        It is as much later as a process that starts has waited for a processor since then.
        """
        return self._last + self._waited(process_id)

    def hear(self, process_id: int) -> None:
        """Take what has come from a process."""
        for word, sender in self._datagrams():
            if sender != process_id:
                continue
            self._last, self._suspected = time.monotonic(), None
            self.ready = self.ready or word == lifetime.READY
            if word.startswith(lifetime.STOPPING):
                self.closing = word.removeprefix(lifetime.STOPPING).decode(errors="replace")
        if not self.ready and self._suspected is None:
            self._suspected = waiting_times(process_id)

    def fault(self, process_id: int) -> str:
        """Return in words what is wrong with a process that runs; empty: nothing.

        A process that waits for a processor or a disk is late, and not hung.
        """
        silence, timeout = time.monotonic() - self._last, self._config.timeout
        if not self.ready or self.closing:
            silence -= self._waited(process_id)
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


CHILD: Final = Path(__file__).with_name("child.py")
LAST_LINES: Final = 12
ASKED_TO_END: Final = (0, INTERRUPTED, -signal.SIGINT)  # codes of a process that did not crash


class ProcessDiedError(SainError):
    """A process of the graph ended though nobody asked it to.

    Attributes:
        reason: in one line.
        exit_code: of the process, as a shell has it.
    """

    def __init__(self, text: str, reason: str = "", exit_code: int = 1) -> None:
        """Say why, and what the process said last."""
        super().__init__(text)
        self.reason, self.exit_code = reason or text, exit_code


@dataclass(frozen=True)
class Fault:
    """Why a process was restarted, and when [s]."""

    why: str
    at: float


@dataclass(frozen=True)
class Child:
    """A process that runs, or ran.

    Attributes:
        name: what it is called in messages.
        command: what was run.
        log: where it writes.
        environment: variables that it has more than this process.
        patient: it has a file to close, and is not hurried before the others are gone.
        again: what restarts it; nothing: its end is the graph's.
        config: of its heartbeats.
        fault: why it was restarted, until it is ready.
    """

    name: str
    command: tuple[str, ...]
    log: Path
    environment: dict[str, str]
    patient: bool
    again: tuple[str, ...]
    config: HeartbeatConfig
    process: "subprocess.Popen[bytes]"
    heartbeats: Heartbeats
    fault: Fault | None = None

    @classmethod
    def start(
        cls,
        name: str,
        command: tuple[str, ...],
        log: Path,
        environment: dict[str, str],
        patient: bool,
        again: tuple[str, ...],
        config: HeartbeatConfig,
    ) -> "Child":
        """Start a process with an empty log.

        Raises:
            OutputError: its log cannot be written.
        """
        try:
            log.parent.mkdir(parents=True, exist_ok=True)
            log.write_bytes(b"")
            running = run(command, log, environment, config)
        except OSError as error:
            raise OutputError(f"cannot start {name} with its log {log}: {error}") from error
        return cls(name, command, log, environment, patient, again, config, *running)

    def restarted(self, why: str) -> "Child":
        """Return this one anew; what is left of it is killed.

        Raises:
            OutputError: its log cannot be written.
        """
        self.send(signal.SIGKILL)
        self.process.wait()
        self.heartbeats.close()
        try:
            process, heartbeats = run(self.again, self.log, self.environment, self.config)
        except OSError as error:
            raise OutputError(f"cannot restart {self.name}: {error}") from error
        since = time.monotonic() if self.fault is None else self.fault.at
        return replace(self, process=process, heartbeats=heartbeats, fault=Fault(why, since))

    @property
    def was_ready(self) -> bool:
        """Whether it, or one that it replaces, has ever been ready."""
        return self.heartbeats.ready or self.fault is not None

    @property
    def has_crashed(self) -> bool:
        """Whether it did not just end as if asked to, and may be restarted."""
        return bool(self.again) and self.was_ready and self.process.poll() not in ASKED_TO_END

    def trouble(self) -> str:
        """Return in words what is wrong with it; empty: nothing."""
        if self.process.poll() is not None:
            return self.describe_end()
        self.heartbeats.hear(self.process.pid)
        # The first start has the time that it takes: whoever waits for it has his own limit.
        return self.heartbeats.fault(self.process.pid) if self.was_ready else ""

    def closing(self) -> str:
        """Return in words what it does before it ends; empty: nothing, or it hangs."""
        self.heartbeats.hear(self.process.pid)
        hangs = self.heartbeats.fault(self.process.pid)
        return "" if hangs else self.heartbeats.closing

    def describe_end(self) -> str:
        """Return in words how it ended."""
        code = self.process.returncode
        if code is not None and code < 0:
            return f"was killed by {signal.Signals(-code).name}"
        return f"ended with exit code {code}"

    def death(self, trouble: str) -> ProcessDiedError:
        """Return the error that says how it ended and what it said last."""
        code = self.process.returncode or 0
        exit_code = code if code >= 0 else 128 - code
        reason = f"{self.name} {trouble}"
        return ProcessDiedError(reason + self.last_words(), reason, exit_code)

    def last_words(self) -> str:
        """Return what to add to an error of this process: what it said last."""
        said = self.last_lines()
        return f"; the end of its log:\n{said}" if said else " and said nothing"

    def last_lines(self, count: int = LAST_LINES) -> str:
        """Return the end of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        lines = [line for line in text.splitlines() if line.strip()]
        return "\n".join(lines[-count:])

    def send(self, number: int) -> None:
        """Send a signal to it and all that it started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)


def run(
    command: tuple[str, ...], log: Path, environment: dict[str, str], config: HeartbeatConfig
) -> tuple["subprocess.Popen[bytes]", Heartbeats]:
    """Run a command that leads a session of its own and appends to a log; raises `OSError`."""
    heartbeats = Heartbeats(config)
    more = {"PYTHONUNBUFFERED": "1", **heartbeats.environment, **environment}
    with log.open("ab") as stream:
        process = subprocess.Popen(
            [sys.executable, "-IS", str(CHILD), str(os.getpid()), *command],
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env={**os.environ, **more},
            start_new_session=True,
        )
    return process, heartbeats
