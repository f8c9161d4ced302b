"""One process of a graph: how it is started, what it says, and how it ended."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from sain_bringup.heartbeats import HeartbeatConfig, Heartbeats
from sain_core.errors import INTERRUPTED, OutputError, SainError

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
