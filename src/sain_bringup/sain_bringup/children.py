"""One process of a graph: how it is started, that it is ready and lives, and how it ended.

For its heartbeats see `sain_core.guarding.lifetime`.
"""

import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.errors import INTERRUPTED, OutputError, SainError
from sain_core.guarding import lifetime

CREDENTIALS: Final = struct.Struct("3i")  # process, user and group of who sent a datagram
LONGEST: Final = 200  # bytes of a datagram that are read
LOOK: Final = 0.25  # [s] at most between two looks, unless the whole machine stands still


@dataclass(frozen=True)
class RestartLimits:
    """When a process counts as hung, and when it is restarted no more. Times are in seconds."""

    timeout: float = 1.0  # silence after which it counts as hung: four heartbeats, as in `bond`
    connect_timeout: float = 30.0  # for a restarted process to get ready
    crashes: int = 3  # within the window, that end the graph
    window: float = 60.0


class Heartbeats:
    """The heartbeats of one process, which gets `environment`."""

    def __init__(self, limits: RestartLimits) -> None:
        self._limits = limits
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self._socket.setblocking(False)
        self._socket.bind("")  # the kernel chooses an abstract address that is free
        self._last = self._looked = time.monotonic()
        self._suspected: dict[str, int] | None = None
        self.ready = False
        self.closing = ""  # what it does before it ends, when it is about to

    @property
    def environment(self) -> dict[str, str]:
        """What makes a process send heartbeats here."""
        address = self._socket.getsockname().decode("ascii").replace("\0", "@")
        return {lifetime.SOCKET: address, lifetime.TIMEOUT: str(round(1e6 * self._limits.timeout))}

    def heard_at(self, process_id: int) -> float:
        """Return when the last heartbeat came [s], or when the process was started.

        It is as much later as a process that starts has waited for a processor since then.
        """
        return self._last + self._waited(process_id)

    def hear(self, process_id: int) -> None:
        """Take what has come from a process.

        Time in which nobody looked is no silence: a machine that stood still had no heartbeats.
        """
        now = time.monotonic()
        unseen, self._looked = now - self._looked, now
        if unseen > LOOK:
            self._last += unseen
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
        silence, timeout = time.monotonic() - self._last, self._limits.timeout
        if not self.ready or self.closing:
            silence -= self._waited(process_id)
            limit = self._limits.connect_timeout
            if silence <= limit:
                return ""
            closing = f"was silent for {limit:g} s while {self.closing}"
            return closing if self.closing else f"was not ready within {limit:g} s"
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
                space = socket.CMSG_SPACE(CREDENTIALS.size)
                word, about, _, _ = self._socket.recvmsg(LONGEST, space)
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
    """A process of the graph ended on its own; `reason` is one line, `exit_code` as in a shell."""

    def __init__(self, text: str, reason: str = "", exit_code: int = 1) -> None:
        super().__init__(text)
        self.reason, self.exit_code = reason or text, exit_code


class Child:
    """A process that runs, or ran.

    Attributes:
        patient: it has a file to close, and is not hurried before the others are gone.
        fault: why it was restarted, until it is ready; empty: it was not.
        failed_at: when it had to be restarted [s].
    """

    def __init__(
        self,
        name: str,
        command: tuple[str, ...],
        log: Path,
        environment: dict[str, str],
        patient: bool,
        again: tuple[str, ...],
        limits: RestartLimits,
    ) -> None:
        """Start a process with an empty log; `again` restarts it, nothing: its end is the graph's.

        Raises:
            OutputError: its log cannot be written.
        """
        self.name, self.log, self.patient = name, log, patient
        self._environment, self._again, self._limits = environment, again, limits
        self.fault, self.failed_at = "", 0.0
        try:
            log.parent.mkdir(parents=True, exist_ok=True)
            log.write_bytes(b"")
            self._run(command)
        except OSError as error:
            raise OutputError(f"cannot start {name} with its log {log}: {error}") from error

    def _run(self, command: tuple[str, ...]) -> None:
        """Run a command that leads a session of its own and appends to the log."""
        self.heartbeats = Heartbeats(self._limits)
        more = {"PYTHONUNBUFFERED": "1", **self.heartbeats.environment, **self._environment}
        with self.log.open("ab") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-IS", str(CHILD), str(os.getpid()), *command],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                env={**os.environ, **more},
                start_new_session=True,
            )

    def restart(self, why: str) -> None:
        """Run it anew; what is left of it is killed. Raises `OutputError` as its start."""
        self.send(signal.SIGKILL)
        self.process.wait()
        self.heartbeats.close()
        self.failed_at = self.failed_at if self.fault else time.monotonic()
        self.fault = why
        try:
            self._run(self._again)
        except OSError as error:
            raise OutputError(f"cannot restart {self.name}: {error}") from error

    @property
    def has_crashed(self) -> bool:
        """Whether it was ready and did not end as if asked to: it may be restarted."""
        return bool(self._again) and self._was_ready and self.process.poll() not in ASKED_TO_END

    @property
    def _was_ready(self) -> bool:
        return self.heartbeats.ready or bool(self.fault)

    def trouble(self) -> str:
        """Return in words what is wrong with it; empty: nothing."""
        code = self.process.poll()
        if code is not None:
            killed = f"was killed by {signal.Signals(-code).name}" if code < 0 else ""
            return killed or f"ended with exit code {code}"
        self.heartbeats.hear(self.process.pid)
        # The first start has the time that it takes: whoever waits for it has his own limit.
        return self.heartbeats.fault(self.process.pid) if self._was_ready else ""

    def closing(self) -> str:
        """Return in words what it does before it ends; empty: nothing, or it hangs."""
        self.heartbeats.hear(self.process.pid)
        return "" if self.heartbeats.fault(self.process.pid) else self.heartbeats.closing

    def death(self, trouble: str) -> ProcessDiedError:
        """Return the error that says how it ended and what it said last."""
        code = self.process.returncode or 0
        reason = f"{self.name} {trouble}"
        return ProcessDiedError(
            reason + self.last_words(), reason, code if code >= 0 else 128 - code
        )

    def last_words(self) -> str:
        """Return what to add to an error of this process: the end of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        lines = [line for line in text.splitlines() if line.strip()][-LAST_LINES:]
        return "; the end of its log:\n" + "\n".join(lines) if lines else " and said nothing"

    def send(self, number: int) -> None:
        """Send a signal to it and all that it started."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)
